#include "device/projector/glass.h"

#include <math.h>
#include <string.h>

#include "device/live_kernels.h"
#include "device/projector/codes.h"
#include "device/projector/shaders.h"

enum { N = CLT_PANEL_CHANNELS, TEXEL_CHANNELS = 4 };
enum { CODES, LIVE, STRETCHED, PROGRAMS };

int clt_glass_bits(void) {
  static const GLenum sizes[N] = {GL_FRAMEBUFFER_ATTACHMENT_RED_SIZE, GL_FRAMEBUFFER_ATTACHMENT_GREEN_SIZE,
                                  GL_FRAMEBUFFER_ATTACHMENT_BLUE_SIZE};
  GLint least = 16;
  for (int c = 0; c < N; c++) {
    GLint bits = 0;
    glGetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, GL_BACK_LEFT, sizes[c], &bits);
    least = bits < least ? bits : least;
  }
  return least;
}

static GLuint compile(GLenum kind, const char *text, clt_error *error) {
  GLint good = 0;
  GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &text, NULL);
  glCompileShader(shader);
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (!good) {
    char log[256] = "";
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    clt_fail(error, CLT_FAILED, "the GL driver (%s) refuses a shader; update it: %.200s",
             (const char *)glGetString(GL_RENDERER), log);
  }
  return shader;
}

static clt_status link_program(const char *fragments, GLuint *program, clt_error *error) {
  clt_error problem = {0};
  GLuint parts[2] = {compile(GL_VERTEX_SHADER, clt_shader_vertices, &problem),
                     compile(GL_FRAGMENT_SHADER, fragments, &problem)};
  *program = glCreateProgram();
  for (int i = 0; i < 2; i++) {
    glAttachShader(*program, parts[i]);
    glDeleteShader(parts[i]);
  }
  glLinkProgram(*program);
  GLint good = 0;
  glGetProgramiv(*program, GL_LINK_STATUS, &good);
  if (problem.status == CLT_OK && !good) {
    char log[256] = "";
    glGetProgramInfoLog(*program, sizeof log, NULL, log);
    clt_fail(&problem, CLT_FAILED, "the GL driver cannot link a program; update it: %.200s", log);
  }
  return problem.status == CLT_OK ? CLT_OK : clt_fail(error, problem.status, "%s", problem.message);
}

/* Codes go to the glass as they are: nothing may blend, dither or encode them again. */
static void plain_state(void) {
  static const GLenum off[] = {GL_DITHER,     GL_BLEND,        GL_FRAMEBUFFER_SRGB, GL_MULTISAMPLE,
                               GL_DEPTH_TEST, GL_STENCIL_TEST, GL_SCISSOR_TEST,     GL_CULL_FACE};
  for (size_t i = 0; i < sizeof off / sizeof off[0]; i++) {
    glDisable(off[i]);
  }
}

static clt_upload table_of(GLint internal, GLenum format, size_t bytes) {
  return (clt_upload){
      .target = GL_TEXTURE_2D, .internal = internal, .format = format, .type = GL_FLOAT, .bytes = bytes};
}

static void init_uploads(clt_glass *glass) {
  const size_t texel = TEXEL_CHANNELS * sizeof(float);
  bool bytes = glass->bits <= 8;
  glass->codes = (clt_upload){.target = GL_TEXTURE_2D_ARRAY,
                              .internal = bytes ? GL_R8UI : GL_R16UI,
                              .format = GL_RED_INTEGER,
                              .type = bytes ? GL_UNSIGNED_BYTE : GL_UNSIGNED_SHORT,
                              .bytes = bytes ? 1 : 2};
  glass->content = (clt_upload){
      .target = GL_TEXTURE_2D, .internal = GL_RGB8UI, .format = GL_RGB_INTEGER, .type = GL_UNSIGNED_BYTE, .bytes = N};
  glass->gain = glass->offset = table_of(GL_RGBA32F, GL_RGBA, texel);
  glass->encode = table_of(GL_RG32F, GL_RG, sizeof(clt_live_piece));
  glass->decode = table_of(GL_R32F, GL_RED, sizeof(float));
  clt_upload *const all[] = {&glass->codes,  &glass->content, &glass->gain,
                             &glass->offset, &glass->decode,  &glass->encode};
  for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
    clt_upload_init(all[i]);
  }
}

static clt_status lost(clt_error *error) {
  return clt_fail(error, CLT_FAILED, "the GL driver has no memory for a picture; use a smaller mode");
}

static clt_status fill_decode(clt_glass *glass, clt_error *error) {
  static const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  float *table = clt_upload_begin(&glass->decode, CLT_SHADER_DECODE, 1, 1);
  for (int i = 0; i < CLT_SHADER_DECODE && table != NULL; i++) {
    table[i] = (float)clt_curve_decode(&srgb, i / 255.0);
  }
  return table != NULL && clt_upload_end(&glass->decode) ? CLT_OK : lost(error);
}

/* A panel stays the same for hours: its tables are made when it changes. */
static clt_status fill_encode(clt_glass *glass, const clt_panel *panel, clt_error *error) {
  if (glass->encode_known && memcmp(panel, &glass->panel, sizeof *panel) == 0) {
    return CLT_OK;
  }
  clt_live_piece *table = clt_upload_begin(&glass->encode, CLT_LIVE_PIECES, N, 1);
  for (int c = 0; c < N && table != NULL; c++) {
    clt_live_tabulate(&panel->response[c], table + c * CLT_LIVE_PIECES);
  }
  glass->encode_known = table != NULL && clt_upload_end(&glass->encode);
  memcpy(&glass->panel, panel, sizeof *panel);
  return glass->encode_known ? CLT_OK : lost(error);
}

/* What stays for good: which texture stands at which unit, sizes. */
static void set_uniforms(const clt_glass *glass) {
  static const char *const units[] = {"codes", "content", "gain", "offset", "decode", "encode"};
  for (int i = 0; i < PROGRAMS; i++) {
    GLuint program = glass->programs[i];
    glUseProgram(program);
    glUniform2i(glGetUniformLocation(program, "panel"), glass->width, glass->height);
    glUniform1f(glGetUniformLocation(program, "full"), (float)((1 << glass->bits) - 1));
    for (size_t unit = 0; unit < sizeof units / sizeof units[0]; unit++) {
      glUniform1i(glGetUniformLocation(program, units[unit]), (GLint)unit);
    }
  }
}

clt_status clt_glass_open(int width, int height, int bits, clt_glass *glass, clt_error *error) {
  static const char *const fragments[PROGRAMS] = {clt_shader_codes, clt_shader_live, clt_shader_stretched};
  *glass = (clt_glass){.width = width, .height = height, .bits = bits};
  plain_state();
  glGenVertexArrays(1, &glass->vertices);
  init_uploads(glass);
  clt_status status = CLT_OK;
  for (int i = 0; i < PROGRAMS && status == CLT_OK; i++) {
    status = link_program(fragments[i], &glass->programs[i], error);
  }
  status = status == CLT_OK ? fill_decode(glass, error) : status;
  if (status != CLT_OK) {
    clt_glass_close(glass);
    return status;
  }
  set_uniforms(glass);
  return CLT_OK;
}

void clt_glass_close(clt_glass *glass) {
  clt_upload *const all[] = {&glass->codes,  &glass->content, &glass->gain,
                             &glass->offset, &glass->decode,  &glass->encode};
  if (glass->vertices == 0) {
    return;
  }
  for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
    clt_upload_finish(all[i]);
  }
  for (int i = 0; i < PROGRAMS; i++) {
    glDeleteProgram(glass->programs[i]);
  }
  glDeleteVertexArrays(1, &glass->vertices);
  *glass = (clt_glass){0};
}

clt_status clt_glass_put(clt_glass *glass, const float *codes, clt_error *error) {
  size_t count = (size_t)N * (size_t)glass->width * (size_t)glass->height;
  void *to = clt_upload_begin(&glass->codes, glass->width, glass->height, N);
  if (to == NULL) {
    return lost(error);
  }
  if (glass->bits <= 8) {
    clt_codes_to_bytes(codes, count, to);
  } else {
    clt_codes_to_words(codes, count, (1 << glass->bits) - 1, to);
  }
  glass->program = CODES;
  return clt_upload_end(&glass->codes) ? CLT_OK : lost(error);
}

/* Three planes to texels. */
static bool put_field(clt_upload *upload, const float *field, int width, int height) {
  size_t plane = (size_t)width * (size_t)height;
  float *to = clt_upload_begin(upload, width, height, 1);
  for (size_t i = 0; i < plane && to != NULL; i++) {
    to[TEXEL_CHANNELS * i] = field[i];
    to[TEXEL_CHANNELS * i + 1] = field[plane + i];
    to[TEXEL_CHANNELS * i + 2] = field[2 * plane + i];
    to[TEXEL_CHANNELS * i + 3] = 0;
  }
  return to != NULL && clt_upload_end(upload);
}

/* GL's matrices go column by column. */
static void set_unmix(GLuint program, const clt_panel *panel) {
  GLfloat columns[N * N];
  for (int i = 0; i < N * N; i++) {
    columns[i] = panel->mixes ? (GLfloat)panel->unmix[i % N][i / N] : (GLfloat)(i % N == i / N);
  }
  glUseProgram(program);
  glUniformMatrix3fv(glGetUniformLocation(program, "unmix"), 1, GL_FALSE, columns);
}

clt_status clt_glass_put_live(clt_glass *glass, const clt_live_picture *picture, clt_error *error) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  if (picture->width < 1 || picture->width > most || picture->height < 1 || picture->height > most) {
    return clt_fail(error, CLT_BAD_INPUT, "a moving picture of %d x %d pixels; the GL driver takes 1..%d a side",
                    picture->width, picture->height, most);
  }
  clt_status status = fill_encode(glass, &picture->panel, error);
  if (status != CLT_OK) {
    return status;
  }
  uint8_t *to = clt_upload_begin(&glass->content, picture->width, picture->height, 1);
  if (to == NULL) {
    return lost(error);
  }
  memcpy(to, picture->content, (size_t)N * (size_t)picture->width * (size_t)picture->height);
  bool whole = clt_upload_end(&glass->content);
  whole = put_field(&glass->gain, picture->gain, picture->grid_width, picture->grid_height) && whole;
  whole = put_field(&glass->offset, picture->offset, picture->grid_width, picture->grid_height) && whole;
  glass->program = picture->width == glass->width && picture->height == glass->height ? LIVE : STRETCHED;
  set_unmix(glass->programs[glass->program], &picture->panel);
  glass->seed = picture->seed;
  return whole ? CLT_OK : lost(error);
}

void clt_glass_draw(clt_glass *glass, int width, int height) {
  const clt_upload *const units[] = {&glass->codes,  &glass->content, &glass->gain,
                                     &glass->offset, &glass->decode,  &glass->encode};
  GLuint program = glass->programs[glass->program];
  for (size_t unit = 0; unit < sizeof units / sizeof units[0]; unit++) {
    glActiveTexture(GL_TEXTURE0 + (GLenum)unit);
    glBindTexture(units[unit]->target, units[unit]->texture);
  }
  glUseProgram(program);
  glUniform2i(glGetUniformLocation(program, "glass"), width, height);
  if (glass->program != CODES) {
    glUniform1ui(glGetUniformLocation(program, "seed"), glass->seed);
  }
  glBindVertexArray(glass->vertices);
  glViewport(0, 0, width, height);
  glDrawArrays(GL_TRIANGLES, 0, 3);
}
