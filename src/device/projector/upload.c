#include "device/projector/upload.h"

void clt_upload_init(clt_upload *upload) {
  glGenTextures(1, &upload->texture);
  glGenBuffers(CLT_UPLOAD_TURNS, upload->buffers);
  glBindTexture(upload->target, upload->texture);
  glTexParameteri(upload->target, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(upload->target, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTexParameteri(upload->target, GL_TEXTURE_MAX_LEVEL, 0);
}

void clt_upload_finish(clt_upload *upload) {
  if (upload->texture != 0) {
    glDeleteTextures(1, &upload->texture);
    glDeleteBuffers(CLT_UPLOAD_TURNS, upload->buffers);
  }
  *upload = (clt_upload){0};
}

static size_t size_of(const clt_upload *upload) {
  return (size_t)upload->width * (size_t)upload->height * (size_t)upload->layers * upload->bytes;
}

/* Gives the texture and its buffers another size. */
static void resize(clt_upload *upload, int width, int height, int layers) {
  upload->width = width;
  upload->height = height;
  upload->layers = layers;
  for (int i = 0; i < CLT_UPLOAD_TURNS; i++) {
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, upload->buffers[i]);
    glBufferData(GL_PIXEL_UNPACK_BUFFER, (GLsizeiptr)size_of(upload), NULL, GL_STREAM_DRAW);
  }
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
  glBindTexture(upload->target, upload->texture);
  if (upload->target == GL_TEXTURE_2D) {
    glTexImage2D(upload->target, 0, upload->internal, width, height, 0, upload->format, upload->type, NULL);
  } else {
    glTexImage3D(upload->target, 0, upload->internal, width, height, layers, 0, upload->format, upload->type, NULL);
  }
}

void *clt_upload_begin(clt_upload *upload, int width, int height, int layers) {
  if (width != upload->width || height != upload->height || layers != upload->layers) {
    resize(upload, width, height, layers);
  }
  upload->turn = (upload->turn + 1) % CLT_UPLOAD_TURNS;
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, upload->buffers[upload->turn]);
  void *memory = glMapBufferRange(GL_PIXEL_UNPACK_BUFFER, 0, (GLsizeiptr)size_of(upload),
                                  GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT);
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
  return memory;
}

bool clt_upload_end(clt_upload *upload) {
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, upload->buffers[upload->turn]);
  bool whole = glUnmapBuffer(GL_PIXEL_UNPACK_BUFFER);
  if (whole) {
    glBindTexture(upload->target, upload->texture);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    if (upload->target == GL_TEXTURE_2D) {
      glTexSubImage2D(upload->target, 0, 0, 0, upload->width, upload->height, upload->format, upload->type, NULL);
    } else {
      glTexSubImage3D(upload->target, 0, 0, 0, 0, upload->width, upload->height, upload->layers, upload->format,
                      upload->type, NULL);
    }
  }
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
  return whole;
}
