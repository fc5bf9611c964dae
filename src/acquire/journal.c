#include "acquire/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char magic[16] = "clt-journal-1\n";

typedef struct head {
  char magic[sizeof magic];
  uint64_t rig;
} head;

typedef struct record {
  uint64_t drive; /* hash */
  uint64_t bytes; /* of each of the two images that follow */
  uint64_t sum;   /* hash of the images */
} record;

/* FNV-1a over words: Fowler, Noll, Vo. */
static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size) {
  const unsigned char *at = bytes;
  for (; size >= sizeof(uint32_t); at += sizeof(uint32_t), size -= sizeof(uint32_t)) {
    uint32_t word;
    memcpy(&word, at, sizeof word);
    hash = (hash ^ word) * 0x100000001b3u;
    hash ^= hash >> 29;
  }
  for (; size > 0; at++, size--) {
    hash = (hash ^ *at) * 0x100000001b3u;
  }
  return hash;
}
static const uint64_t HASH_START = 0xcbf29ce484222325u;

static uint64_t hash_image(uint64_t hash, const clt_image *image) {
  return hash_bytes(hash, image->data, clt_image_size(image) * sizeof *image->data);
}

static uint64_t hash_rig(const clt_rig_info *info) {
  const int sizes[] = {info->width, info->height, info->channels};
  uint64_t hash = hash_bytes(HASH_START, sizes, sizeof sizes);
  const char *const texts[] = {info->source, info->response};
  for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
    hash = texts[k] != NULL ? hash_bytes(hash, texts[k], strlen(texts[k]) + 1) : hash;
  }
  return hash;
}

static clt_status fail(const clt_journal *journal, const char *what, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s the journal %s: %s", what, journal->path, strerror(errno));
}

/* All of it, or false. */
static bool read_whole(int file, void *bytes, size_t size) {
  for (size_t done = 0; done < size;) {
    const ssize_t got = read(file, (char *)bytes + done, size - done);
    if (got <= 0) {
      return false;
    }
    done += (size_t)got;
  }
  return true;
}

static bool write_whole(int file, const void *bytes, size_t size) {
  for (size_t done = 0; done < size;) {
    const ssize_t put = write(file, (const char *)bytes + done, size - done);
    if (put <= 0) {
      return false;
    }
    done += (size_t)put;
  }
  return true;
}

/* A file shorter than a head is one that was killed while it began. */
static clt_status read_head(clt_journal *journal, const clt_rig_info *info, clt_error *error) {
  head wanted = {.rig = hash_rig(info)}, found;
  memcpy(wanted.magic, magic, sizeof magic);
  if (read_whole(journal->file, &found, sizeof found)) {
    if (memcmp(found.magic, magic, sizeof magic) != 0) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: is no journal of an acquisition; give another name", journal->path);
    }
    if (found.rig != wanted.rig) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: is the journal of another rig, scene or grid; remove it or give another name",
                      journal->path);
    }
    return CLT_OK;
  }
  struct stat file;
  if (fstat(journal->file, &file) != 0 || file.st_size >= (off_t)sizeof found ||
      lseek(journal->file, 0, SEEK_SET) != 0 || ftruncate(journal->file, 0) != 0 ||
      !write_whole(journal->file, &wanted, sizeof wanted)) {
    return fail(journal, "could not begin", error);
  }
  return CLT_OK;
}

clt_status clt_journal_open(clt_journal *journal, const char *path, const clt_rig_info *info, clt_error *error) {
  *journal = (clt_journal){.file = -1, .path = path};
  if (path == NULL) {
    return CLT_OK;
  }
  journal->file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (journal->file < 0) {
    return fail(journal, "could not open", error);
  }
  journal->replaying = true;
  return read_head(journal, info, error);
}

clt_status clt_journal_open_unnamed(clt_journal *journal, clt_error *error) {
  *journal = (clt_journal){.file = -1, .unnamed = true, .path = "in a temporary file"};
  FILE *file = tmpfile();
  if (file != NULL) {
    journal->file = fcntl(fileno(file), F_DUPFD_CLOEXEC, 0);
    fclose(file);
  }
  return journal->file >= 0 ? CLT_OK : fail(journal, "could not open", error);
}

void clt_journal_close(clt_journal *journal) {
  if (journal->path != NULL && journal->file >= 0) {
    close(journal->file);
    journal->file = -1;
  }
}

static bool read_record(const clt_journal *journal, const clt_image *drive, clt_image *seen, clt_image *deviation) {
  const size_t bytes = clt_image_size(drive) * sizeof *drive->data;
  record next;
  return read_whole(journal->file, &next, sizeof next) && next.bytes == bytes &&
         next.drive == hash_image(HASH_START, drive) && read_whole(journal->file, seen->data, bytes) &&
         read_whole(journal->file, deviation->data, bytes) &&
         next.sum == hash_image(hash_image(HASH_START, seen), deviation);
}

clt_status clt_journal_replay(clt_journal *journal, const clt_image *drive, clt_image *seen, clt_image *deviation,
                              bool *found, clt_error *error) {
  *found = false;
  if (journal->file < 0 || !journal->replaying) {
    return CLT_OK;
  }
  const off_t here = lseek(journal->file, 0, SEEK_CUR);
  *found = here >= 0 && read_record(journal, drive, seen, deviation);
  if (*found) {
    return CLT_OK;
  }
  journal->replaying = false;
  return here >= 0 && lseek(journal->file, here, SEEK_SET) == here && ftruncate(journal->file, here) == 0
             ? CLT_OK
             : fail(journal, "could not continue", error);
}

bool clt_journal_is_replaying(const clt_journal *journal) {
  if (journal->file < 0 || !journal->replaying) {
    return false;
  }
  record next;
  struct stat file;
  const off_t here = lseek(journal->file, 0, SEEK_CUR);
  return here >= 0 && pread(journal->file, &next, sizeof next, here) == (ssize_t)sizeof next &&
         fstat(journal->file, &file) == 0 && here + (off_t)(sizeof next + 2 * next.bytes) <= file.st_size;
}

bool clt_journal_next_is(const clt_journal *journal, const clt_image *drive) {
  record next;
  const off_t here = lseek(journal->file, 0, SEEK_CUR);
  return here >= 0 && pread(journal->file, &next, sizeof next, here) == (ssize_t)sizeof next &&
         next.drive == hash_image(HASH_START, drive);
}

clt_status clt_journal_add(clt_journal *journal, const clt_image *drive, const clt_image *seen,
                           const clt_image *deviation, clt_error *error) {
  if (journal->file < 0) {
    return CLT_OK;
  }
  const size_t bytes = clt_image_size(drive) * sizeof *drive->data;
  const record next = {.drive = hash_image(HASH_START, drive),
                       .bytes = bytes,
                       .sum = hash_image(hash_image(HASH_START, seen), deviation)};
  return write_whole(journal->file, &next, sizeof next) && write_whole(journal->file, seen->data, bytes) &&
                 write_whole(journal->file, deviation->data, bytes) &&
                 (journal->unnamed || fdatasync(journal->file) == 0)
             ? CLT_OK
             : fail(journal, "could not write", error);
}

off_t clt_journal_here(const clt_journal *journal) {
  return journal->file >= 0 ? lseek(journal->file, 0, SEEK_CUR) : 0;
}

clt_status clt_journal_go_back(clt_journal *journal, off_t start, off_t end, clt_error *error) {
  journal->replaying = true;
  return ftruncate(journal->file, end) == 0 && lseek(journal->file, start, SEEK_SET) == start
             ? CLT_OK
             : fail(journal, "could not go back in", error);
}
