#include "device/projector/shaders.h"

/* One triangle over all of the window. */
const char clt_shader_vertices[] = "#version 330 core\n"
                                   "void main() {\n"
                                   "  vec2 corner = vec2((gl_VertexID & 1) << 2, (gl_VertexID & 2) << 1);\n"
                                   "  gl_Position = vec4(corner - 1.0, 0.0, 1.0);\n"
                                   "}\n";

/* What all have: the panel's pixel under the middle of a fragment, row 0 at the top. */
#define PANEL                                                                                                          \
  "#version 330 core\n"                                                                                                \
  "uniform ivec2 panel, glass;\n"                                                                                      \
  "uniform float full;\n"                                                                                              \
  "out vec4 shown;\n"                                                                                                  \
  "ivec2 pixel() {\n"                                                                                                  \
  "  ivec2 p = ivec2(gl_FragCoord.xy * (vec2(panel) / vec2(glass)));\n"                                                \
  "  return ivec2(p.x, panel.y - 1 - p.y);\n"                                                                          \
  "}\n"

/* code / full comes back as the same code from the window, which rounds code / full * full. */
const char clt_shader_codes[] =
    PANEL "uniform usampler2DArray codes;\n"
          "float code(ivec2 p, int c) { return float(texelFetch(codes, ivec3(p, c), 0).r); }\n"
          "void main() {\n"
          "  ivec2 p = pixel();\n"
          "  shown = vec4(vec3(code(p, 0), code(p, 1), code(p, 2)) / full, 1.0);\n"
          "}\n";

/* Interpolation is written out: filters of textures may weigh in steps of 1/256. */
#define TABLES                                                                                                         \
  "uniform usampler2D content;\n"                                                                                      \
  "uniform sampler2D gain, offset, decode, encode;\n"                                                                  \
  "uniform mat3 unmix;\n"                                                                                              \
  "uniform uint seed;\n"                                                                                               \
  "struct place { ivec2 low, high; vec2 part; };\n"                                                                    \
  "place between(ivec2 p, ivec2 size) {\n"                                                                             \
  "  vec2 at = clamp((vec2(p) + 0.5) * (vec2(size) / vec2(panel)) - 0.5, vec2(0.0), vec2(size - 1));\n"                \
  "  ivec2 low = ivec2(at);\n"                                                                                         \
  "  return place(low, min(low + 1, size - 1), at - vec2(low));\n"                                                     \
  "}\n"                                                                                                                \
  "vec3 blend(place w, vec3 a, vec3 b, vec3 c, vec3 d) {\n"                                                            \
  "  return mix(mix(a, b, w.part.x), mix(c, d, w.part.x), w.part.y);\n"                                                \
  "}\n"                                                                                                                \
  "vec3 on_grid(sampler2D field, place w) {\n"                                                                         \
  "  return blend(w, texelFetch(field, w.low, 0).rgb, texelFetch(field, ivec2(w.high.x, w.low.y), 0).rgb,\n"           \
  "               texelFetch(field, ivec2(w.low.x, w.high.y), 0).rgb, texelFetch(field, w.high, 0).rgb);\n"            \
  "}\n"                                                                                                                \
  "vec3 light(ivec2 t) {\n"                                                                                            \
  "  ivec3 s = ivec3(texelFetch(content, t, 0).rgb);\n"                                                                \
  "  return vec3(texelFetch(decode, ivec2(s.r, 0), 0).r, texelFetch(decode, ivec2(s.g, 0), 0).r,\n"                    \
  "              texelFetch(decode, ivec2(s.b, 0), 0).r);\n"                                                           \
  "}\n"

/* The encoding is tabulated as clt_live_tabulate does it; 107 << 23 are the bits of 2^-20. Dither: code =
 * floor(value + r), r uniform in [0, 1), has the mean `value`; r is pcg3d of pixel and seed (Jarzynski & Olano, "Hash
 * Functions for GPU Rendering", JCGT 9, 2020). */
#define SHOW                                                                                                           \
  "float encoded(float own, int c) {\n"                                                                                \
  "  int at = floatBitsToInt(clamp(own, 0.0, 1.0) + 1.0 / 1048576.0) - (107 << 23);\n"                                 \
  "  vec2 piece = texelFetch(encode, ivec2(at >> 17, c), 0).rg;\n"                                                     \
  "  return piece.r + float(at & 131071) * (1.0 / 131072.0) * piece.g;\n"                                              \
  "}\n"                                                                                                                \
  "vec3 random(uvec3 v) {\n"                                                                                           \
  "  v = v * 1664525u + 1013904223u;\n"                                                                                \
  "  v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;\n"                                                          \
  "  v ^= v >> 16u;\n"                                                                                                 \
  "  v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;\n"                                                          \
  "  return vec3(v >> 8u) * (1.0 / 16777216.0);\n"                                                                     \
  "}\n"                                                                                                                \
  "void main() {\n"                                                                                                    \
  "  ivec2 p = pixel();\n"                                                                                             \
  "  place w = between(p, textureSize(gain, 0));\n"                                                                    \
  "  vec3 drive = clamp(on_grid(gain, w) * content_light(p) + on_grid(offset, w), 0.0, 1.0);\n"                        \
  "  vec3 own = unmix * drive;\n"                                                                                      \
  "  vec3 value = vec3(encoded(own.r, 0), encoded(own.g, 1), encoded(own.b, 2)) * full;\n"                             \
  "  shown = vec4(min(floor(value + random(uvec3(p, seed))), full) / full, 1.0);\n"                                    \
  "}\n"

const char clt_shader_live[] = PANEL TABLES "vec3 content_light(ivec2 p) { return light(p); }\n" SHOW;

/* A program of its own: software drawing walks both ways of a branch, and this one is four times as long. */
const char clt_shader_stretched[] =
    PANEL TABLES "vec3 content_light(ivec2 p) {\n"
                 "  place w = between(p, textureSize(content, 0));\n"
                 "  return blend(w, light(w.low), light(ivec2(w.high.x, w.low.y)), light(ivec2(w.low.x, w.high.y)), "
                 "light(w.high));\n"
                 "}\n" SHOW;
