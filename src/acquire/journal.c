#include "acquire/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/log.h"

static const char magic[16] = "clt-journal-1\n";
/* What a dispensable one may grow to. */
static const off_t DISPENSABLE_MOST = (off_t)1 << 30;

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

static uint64_t hash_rig(const clt_rig_info *info, const char *of) {
  const int sizes[] = {info->width, info->height, info->channels};
  uint64_t hash = hash_bytes(HASH_START, sizes, sizeof sizes);
  const char *const texts[] = {info->source, info->response, of};
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

static clt_status begin(clt_journal *journal, const head *wanted, clt_error *error) {
  return lseek(journal->file, 0, SEEK_SET) == 0 && ftruncate(journal->file, 0) == 0 &&
                 write_whole(journal->file, wanted, sizeof *wanted)
             ? CLT_OK
             : fail(journal, "could not begin", error);
}

/* NULL, or why the file is not continued. */
static const char *find_fault(const head *found, const head *wanted) {
  if (memcmp(found->magic, wanted->magic, sizeof magic) != 0) {
    return "is no journal of an acquisition; give another name";
  }
  return found->rig == wanted->rig ? NULL
                                   : "is the journal of another rig, scene or grid; remove it or give another name";
}

/* By the clock of the day, which may have been set: a file of the future is of no known age. */
static bool is_too_old(const struct stat *file, double most_s) {
  const double age_s = difftime(time(NULL), file->st_mtime);
  return most_s > 0 && (age_s > most_s || age_s < -most_s);
}

/* A file shorter than a head is one that was killed while it began. */
static clt_status read_head(clt_journal *journal, const clt_acquire_options *options, const clt_rig_info *info,
                            clt_error *error) {
  head wanted = {.rig = hash_rig(info, options->journal_of)}, found;
  struct stat file;
  memcpy(wanted.magic, magic, sizeof magic);
  if (fstat(journal->file, &file) != 0) {
    return fail(journal, "could not open", error);
  }
  if (!read_whole(journal->file, &found, sizeof found)) {
    return file.st_size < (off_t)sizeof found ? begin(journal, &wanted, error) : fail(journal, "could not read", error);
  }
  const char *fault = find_fault(&found, &wanted);
  if (journal->dispensable && (fault != NULL || is_too_old(&file, options->journal_age_s))) {
    clt_log(CLT_LOG_INFO, "%s: is begun anew: it is %s", journal->path,
            fault != NULL ? "of another rig or configuration" : "too old");
    return begin(journal, &wanted, error);
  }
  if (fault != NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s", journal->path, fault);
  }
  journal->inherited = file.st_size > (off_t)sizeof found;
  return CLT_OK;
}

/* A failure of one that can be done without is said and no more. */
static clt_status do_without(clt_journal *journal, clt_status status, clt_error *error) {
  if (status == CLT_OK || !journal->dispensable) {
    return status;
  }
  clt_log(CLT_LOG_WARNING, "an acquisition that is interrupted will begin anew: %s", error->message);
  *error = (clt_error){0};
  if (journal->file >= 0) {
    unlink(journal->path);
    clt_journal_close(journal);
  }
  return CLT_OK;
}

clt_status clt_journal_open(clt_journal *journal, const clt_acquire_options *options, const clt_rig_info *info,
                            clt_error *error) {
  *journal = (clt_journal){.file = -1, .path = options->journal, .dispensable = options->journal_dispensable};
  if (journal->path == NULL) {
    return CLT_OK;
  }
  clt_error problem = {0};
  journal->file = open(journal->path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  journal->replaying = true;
  clt_status status =
      journal->file >= 0 ? read_head(journal, options, info, &problem) : fail(journal, "could not open", &problem);
  status = do_without(journal, status, &problem);
  return status == CLT_OK ? status : clt_fail(error, status, "%s", problem.message);
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
  journal->replaying = journal->inherited = false;
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

static clt_status add(const clt_journal *journal, const clt_image *drive, const clt_image *seen,
                      const clt_image *deviation, clt_error *error) {
  const size_t bytes = clt_image_size(drive) * sizeof *drive->data;
  const record next = {.drive = hash_image(HASH_START, drive),
                       .bytes = bytes,
                       .sum = hash_image(hash_image(HASH_START, seen), deviation)};
  if (journal->dispensable && clt_journal_here(journal) > DISPENSABLE_MOST) {
    return clt_fail(error, CLT_FAILED, "the journal %s has grown too large", journal->path);
  }
  return write_whole(journal->file, &next, sizeof next) && write_whole(journal->file, seen->data, bytes) &&
                 write_whole(journal->file, deviation->data, bytes) &&
                 (journal->unnamed || journal->dispensable || fdatasync(journal->file) == 0)
             ? CLT_OK
             : fail(journal, "could not write", error);
}

clt_status clt_journal_add(clt_journal *journal, const clt_image *drive, const clt_image *seen,
                           const clt_image *deviation, clt_error *error) {
  if (journal->file < 0) {
    return CLT_OK;
  }
  clt_error problem = {0};
  clt_status status = do_without(journal, add(journal, drive, seen, deviation, &problem), &problem);
  return status == CLT_OK ? status : clt_fail(error, status, "%s", problem.message);
}

off_t clt_journal_here(const clt_journal *journal) {
  return journal->file >= 0 ? lseek(journal->file, 0, SEEK_CUR) : 0;
}

clt_status clt_journal_go_back(clt_journal *journal, off_t start, off_t end, clt_error *error) {
  journal->replaying = true;
  journal->inherited = false;
  return ftruncate(journal->file, end) == 0 && lseek(journal->file, start, SEEK_SET) == start
             ? CLT_OK
             : fail(journal, "could not go back in", error);
}
