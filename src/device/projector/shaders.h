/* The programs that run on the graphics processor. */
#ifndef CLT_DEVICE_PROJECTOR_SHADERS_H
#define CLT_DEVICE_PROJECTOR_SHADERS_H

extern const char clt_shader_vertices[], clt_shader_codes[], clt_shader_live[];

/* Entries of the tables that clt_shader_live reads. */
enum { CLT_SHADER_DECODE = 256, CLT_SHADER_ENCODE = 4096 };

#endif
