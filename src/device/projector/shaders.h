/* The programs that run on the graphics processor. */
#ifndef CLT_DEVICE_PROJECTOR_SHADERS_H
#define CLT_DEVICE_PROJECTOR_SHADERS_H

extern const char clt_shader_vertices[], clt_shader_codes[];
/* Moving pictures: of content that has the panel's size, and of any other, which is stretched over it. */
extern const char clt_shader_live[], clt_shader_stretched[];

/* Entries of the table of light. */
enum { CLT_SHADER_DECODE = 256 };

#endif
