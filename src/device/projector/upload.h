/* Pixels on their way to a texture, through buffers in turn, so that writing the next picture never waits for the
 * drawing of the last one. */
#ifndef CLT_DEVICE_PROJECTOR_UPLOAD_H
#define CLT_DEVICE_PROJECTOR_UPLOAD_H

#include <stdbool.h>
#include <stddef.h>

#include <epoxy/gl.h>

enum { CLT_UPLOAD_TURNS = 3 };

/* A texture that is fetched texel by texel, and the buffers that feed it. */
typedef struct clt_upload {
  GLenum target;             /* GL_TEXTURE_2D, or GL_TEXTURE_2D_ARRAY of layers */
  GLint internal;            /* format of the texture */
  GLenum format, type;       /* of the buffers */
  int width, height, layers; /* of the texture at present; 0: none yet */
  size_t bytes;              /* of a texel in the buffers */
  GLuint texture, buffers[CLT_UPLOAD_TURNS];
  int turn;
} clt_upload;

/* Makes the GL objects; target, internal, format, type and bytes are set. */
void clt_upload_init(clt_upload *upload);
void clt_upload_finish(clt_upload *upload); /* accepts a zeroed one */
/* Memory for the texture's next content, width x height texels of each layer without gaps; NULL where there is none. */
void *clt_upload_begin(clt_upload *upload, int width, int height, int layers);
/* Sends it. False where the memory was lost meanwhile: the texture keeps what it had. */
bool clt_upload_end(clt_upload *upload);

#endif
