#include "image/film.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/memory.h"
#include "image/cell_means.h"
#include "image/video_shim.h"

enum { COLOURS = 3 };

typedef struct film_kind {
  bool (*takes)(const char *path);
  clt_status (*open)(clt_film *film, clt_error *error);
  /* One try at the next frame; *shown is false where there was none: it could not be decoded, or the end came. */
  clt_status (*next)(clt_film *film, uint8_t *codes, clt_film_frame *frame, bool *shown, clt_error *error);
} film_kind;

struct clt_film {
  const film_kind *kind;
  char path[CLT_PATH_MAX];
  clt_film_options options;
  int tries;     /* in a row that are a whole round */
  char **names;  /* of a folder */
  int count, at; /* of names; the next one */
  clt_video *video;
  double frame_s;
  clt_film_source source; /* NULLs: none */
  int source_size[2];     /* of its last picture */
  int rectangle[4];       /* of a frame: what has the panel's aspect */
  uint8_t *whole;         /* that rectangle, where it has more pixels than the panel */
  float *light;           /* and what it becomes */
};

static bool is_folder(const char *path) {
  struct stat about;
  return stat(path, &about) == 0 && S_ISDIR(about.st_mode);
}

static bool is_picture(const char *path) {
  static const char *const endings[] = {".png", ".jpg", ".jpeg", ".exr", ".npy"};
  const char *ending = strrchr(path, '.');
  for (size_t i = 0; ending != NULL && i < sizeof endings / sizeof endings[0]; i++) {
    if (strcasecmp(ending, endings[i]) == 0) {
      return true;
    }
  }
  return false;
}

static bool is_other(const char *path) {
  return !is_folder(path) && !is_picture(path);
}

bool clt_film_moves(const char *path) {
  return is_folder(path) || is_other(path);
}

/* A picture as codes at the panel's size, or at its own, cropped, where that is smaller. */
static clt_status read_picture(const clt_film *film, const char *path, uint8_t *codes, clt_film_frame *frame,
                               clt_error *error) {
  clt_image picture = {0}, coloured = {0}, fitting = {0};
  clt_status status = clt_image_read(path, NULL, &picture, error);
  status = status == CLT_OK ? clt_image_convert(&picture, COLOURS, &coloured, error) : status;
  status = status == CLT_OK ? clt_image_resize(&coloured, film->options.height, film->options.width, &fitting, error)
                            : status;
  if (status == CLT_OK) {
    clt_srgb_codes(fitting.data, (size_t)fitting.width * (size_t)fitting.height, codes);
    *frame = (clt_film_frame){fitting.width, fitting.height, film->options.picture_s};
  }
  clt_image_finish(&picture);
  clt_image_finish(&coloured);
  clt_image_finish(&fitting);
  return status;
}

static clt_status open_picture(clt_film *film, clt_error *error) {
  (void)error;
  film->tries = 1;
  return CLT_OK;
}

static clt_status next_picture(clt_film *film, uint8_t *codes, clt_film_frame *frame, bool *shown, clt_error *error) {
  clt_status status = read_picture(film, film->path, codes, frame, error);
  *shown = status == CLT_OK;
  frame->seconds = INFINITY;
  return status;
}

static int chosen(const struct dirent *entry) {
  return entry->d_name[0] != '.' && is_picture(entry->d_name);
}

static clt_status open_folder(clt_film *film, clt_error *error) {
  struct dirent **entries = NULL;
  int count = scandir(film->path, &entries, chosen, alphasort);
  film->names = count > 0 ? clt_alloc((size_t)count, sizeof *film->names) : NULL;
  for (int i = 0; i < count; i++) {
    if (film->names != NULL) {
      film->names[film->count] = strdup(entries[i]->d_name);
      film->count += film->names[film->count] != NULL;
    }
    free(entries[i]);
  }
  free(entries);
  film->tries = film->count;
  return film->count > 0 ? CLT_OK
                         : clt_fail(error, CLT_BAD_INPUT, "%s: there are no pictures in this folder", film->path);
}

static clt_status next_of_folder(clt_film *film, uint8_t *codes, clt_film_frame *frame, bool *shown, clt_error *error) {
  char path[CLT_PATH_MAX];
  const char *name = film->names[film->at];
  film->at = (film->at + 1) % film->count;
  clt_status status = clt_file_join(film->path, name, path, error);
  *shown = status == CLT_OK && read_picture(film, path, codes, frame, error) == CLT_OK;
  return status;
}

/* The largest rectangle about the middle of the frame that has the panel's aspect. */
static void crop(clt_film *film, int width, int height) {
  int64_t across = film->options.width, down = film->options.height;
  int kept_width = width, kept_height = height;
  if (width * down > height * across) {
    kept_width = (int)((height * across + down / 2) / down);
  } else {
    kept_height = (int)((width * down + across / 2) / across);
  }
  kept_width = kept_width < 1 ? 1 : kept_width;
  kept_height = kept_height < 1 ? 1 : kept_height;
  const int found[4] = {(width - kept_width) / 2, (height - kept_height) / 2, kept_width, kept_height};
  memcpy(film->rectangle, found, sizeof found);
}

static bool is_larger(const clt_film *film) {
  return film->rectangle[2] > film->options.width || film->rectangle[3] > film->options.height;
}

/* Prepares for frames of that size. */
static clt_status fit(clt_film *film, int width, int height, clt_error *error) {
  crop(film, width, height);
  free(film->whole);
  free(film->light);
  film->whole = NULL;
  film->light = NULL;
  if (is_larger(film)) {
    film->whole = clt_alloc((size_t)film->rectangle[2] * (size_t)film->rectangle[3] * COLOURS, 1);
    film->light = clt_alloc((size_t)film->options.width * (size_t)film->options.height * COLOURS, sizeof(float));
  }
  bool ready = !is_larger(film) || (film->whole != NULL && film->light != NULL);
  return ready ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: memory is short for its frames", film->path);
}

static clt_status open_video(clt_film *film, clt_error *error) {
  clt_video_info info;
  clt_status status = clt_video_open(film->path, &film->video, &info, error);
  if (status != CLT_OK) {
    return status;
  }
  film->tries = 2; /* the end, then the first frame */
  film->frame_s = 1 / info.rate_hz;
  return fit(film, info.width, info.height, error);
}

/* The rectangle of a frame, which lies in `whole` where it is larger than the panel and is made smaller into codes. */
static clt_status shrink(const clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error) {
  int width = film->options.width, height = film->options.height;
  *frame = (clt_film_frame){film->rectangle[2], film->rectangle[3], film->frame_s};
  if (!is_larger(film)) {
    return CLT_OK;
  }
  clt_status status = clt_cell_means(film->whole, frame->width, frame->height, width, height, film->light, error);
  clt_srgb_codes(film->light, (size_t)width * (size_t)height, codes);
  *frame = (clt_film_frame){width, height, film->frame_s};
  return status;
}

static clt_status next_of_video(clt_film *film, uint8_t *codes, clt_film_frame *frame, bool *shown, clt_error *error) {
  bool end = false, larger = is_larger(film);
  clt_status status = clt_video_read(film->video, film->rectangle, larger ? film->whole : codes, &end, error);
  *shown = status == CLT_OK && !end;
  if (!*shown) {
    return clt_video_rewind(film->video, error);
  }
  return shrink(film, codes, frame, error);
}

static clt_status next_of_source(clt_film *film, uint8_t *codes, clt_film_frame *frame, bool *shown, clt_error *error) {
  const uint8_t *from = NULL;
  int width = 0, height = 0;
  clt_status status = film->source.next(film->source.self, &from, &width, &height, error);
  if (status == CLT_OK && (width != film->source_size[0] || height != film->source_size[1])) {
    status = fit(film, width, height, error);
    film->source_size[0] = status == CLT_OK ? width : 0;
    film->source_size[1] = height;
  }
  if (status != CLT_OK) {
    return status;
  }
  const int *kept = film->rectangle;
  uint8_t *to = is_larger(film) ? film->whole : codes;
  size_t row = (size_t)kept[2] * COLOURS;
  for (int y = 0; y < kept[3]; y++) {
    memcpy(to + (size_t)y * row, from + ((size_t)(kept[1] + y) * (size_t)width + (size_t)kept[0]) * COLOURS, row);
  }
  *shown = true;
  return shrink(film, codes, frame, error);
}

static const film_kind kinds[] = {{is_folder, open_folder, next_of_folder},
                                  {is_picture, open_picture, next_picture},
                                  {is_other, open_video, next_of_video}};

clt_status clt_film_of_source(const clt_film_source *source, const clt_film_options *options, clt_film **out,
                              clt_error *error) {
  static const film_kind kind = {.next = next_of_source};
  clt_film *film = clt_alloc(1, sizeof *film);
  if (film == NULL) {
    source->close(source->self);
    return clt_fail(error, CLT_FAILED, "a video input: out of memory");
  }
  *film = (clt_film){.kind = &kind, .path = "video input", .options = *options, .tries = 1, .source = *source};
  *out = film;
  return CLT_OK;
}

clt_status clt_film_open(const char *path, const clt_film_options *options, clt_film **out, clt_error *error) {
  clt_film *film = clt_alloc(1, sizeof *film);
  if (film == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", path);
  }
  *film = (clt_film){.kind = kinds, .options = *options};
  snprintf(film->path, sizeof film->path, "%s", path);
  while (!film->kind->takes(path)) {
    film->kind++;
  }
  clt_status status = film->kind->open(film, error);
  if (status != CLT_OK) {
    clt_film_close(film);
    return status;
  }
  *out = film;
  return CLT_OK;
}

void clt_film_close(clt_film *film) {
  if (film == NULL) {
    return;
  }
  for (int i = 0; i < film->count; i++) {
    free(film->names[i]);
  }
  free(film->names);
  clt_video_close(film->video);
  if (film->source.close != NULL) {
    film->source.close(film->source.self);
  }
  free(film->whole);
  free(film->light);
  free(film);
}

size_t clt_film_bytes(const clt_film *film) {
  size_t panel = (size_t)film->options.width * (size_t)film->options.height * COLOURS;
  size_t frame = (size_t)film->rectangle[2] * (size_t)film->rectangle[3] * COLOURS;
  return is_larger(film) || frame < panel ? panel : frame;
}

clt_status clt_film_next(clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error) {
  bool shown = false;
  clt_status status = CLT_OK;
  for (int k = 0; k < film->tries && !shown && status == CLT_OK; k++) {
    status = film->kind->next(film, codes, frame, &shown, error);
  }
  return status == CLT_OK && !shown
             ? clt_fail(error, CLT_BAD_INPUT, "%s: nothing in it can be decoded any more", film->path)
             : status;
}

static clt_status first_frame(const char *path, const clt_video_info *info, clt_image *picture, clt_error *error) {
  clt_film *film = NULL;
  clt_film_frame frame;
  uint8_t *codes = NULL;
  clt_film_options options = {.width = info->width, .height = info->height, .picture_s = 1};
  clt_status status = clt_film_open(path, &options, &film, error);
  if (status == CLT_OK) {
    codes = clt_alloc(clt_film_bytes(film), 1);
    status = codes != NULL ? clt_film_next(film, codes, &frame, error)
                           : clt_fail(error, CLT_FAILED, "%s: out of memory", path);
  }
  status = status == CLT_OK ? clt_image_init(picture, COLOURS, info->height, info->width, error) : status;
  if (status == CLT_OK) {
    status = clt_cell_means(codes, frame.width, frame.height, info->width, info->height, picture->data, error);
  }
  free(codes);
  clt_film_close(film);
  return status;
}

/* A folder's first picture that can be read keeps its own size. */
static clt_status first_of_folder(const char *path, clt_image *picture, clt_error *error) {
  clt_film film = {0};
  snprintf(film.path, sizeof film.path, "%s", path);
  clt_status status = open_folder(&film, error);
  bool found = false;
  for (int i = 0; i < film.count; i++) {
    char name[CLT_PATH_MAX];
    found = found || (clt_file_join(path, film.names[i], name, NULL) == CLT_OK &&
                      clt_image_read(name, NULL, picture, NULL) == CLT_OK);
    free(film.names[i]);
  }
  free(film.names);
  return status != CLT_OK || found
             ? status
             : clt_fail(error, CLT_BAD_INPUT, "%s: none of the pictures in this folder can be read", path);
}

clt_status clt_film_poster(const char *path, clt_image *picture, clt_error *error) {
  clt_video_info info;
  clt_video *video = NULL;
  if (!clt_film_moves(path)) {
    return clt_image_read(path, NULL, picture, error);
  }
  if (is_folder(path)) {
    return first_of_folder(path, picture, error);
  }
  clt_status status = clt_video_open(path, &video, &info, error);
  clt_video_close(video);
  return status == CLT_OK ? first_frame(path, &info, picture, error) : status;
}
