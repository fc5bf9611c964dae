#include "daemon/output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/memory.h"
#include "daemon/pace.h"
#include "daemon/rank.h"

/* The pace while no projector is open, s; and the time between reports. */
static const double idle_refresh_s = 1.0 / 60, report_s = 0.25;

struct output {
  const daemon_boxes *boxes;
  clt_station station;
  bool begun;          /* the station is */
  bool open, stopping; /* the projector is open */
  clt_projector_info panel;
  clt_panel known;      /* the panel's light, as far as it is known before the rig is */
  output_drive *drive;  /* the latest; survives a reopening */
  float *codes;         /* of the drive on this panel */
  reel_picture *moving; /* the latest; NULL: nothing moves */
  float *moving_codes;  /* of it on this panel, where the projector does not encode by itself */
  pace pace;            /* of the turns */
  rank_work work;       /* to show a moving picture */
  rank_place place;     /* of this thread: where it leaves processors to others, it keeps off them */
  bool measuring;       /* a pattern is on the glass and stays there */
  output_frames frames;
  int64_t reported_ns;
  output_frames reported;
};

clt_status output_create(const daemon_boxes *boxes, output **out, clt_error *error) {
  output *made = clt_alloc(1, sizeof *made);
  if (made == NULL) {
    return clt_fail(error, CLT_FAILED, "the output: out of memory");
  }
  made->boxes = boxes;
  made->reported_ns = clt_clock_ns();
  *out = made;
  return CLT_OK;
}

void output_destroy(output *main) {
  if (main != NULL) {
    clt_station_close(&main->station);
    output_drive_free(main->drive);
    reel_picture_free(main->moving);
    free(main->codes);
    free(main->moving_codes);
    free(main);
  }
}

void output_encode(const output_drive *picture, const clt_projector_info *panel, float *codes) {
  clt_panel_encode(&picture->panel, &picture->drive, panel->channels, panel->height, panel->width, codes);
}

/* Makes the drive's codes for the panel that is open. */
static void encode_drive(output *main) {
  free(main->codes);
  main->codes = NULL;
  if (!main->open || main->drive == NULL) {
    return;
  }
  main->codes = clt_alloc((size_t)main->panel.channels * main->panel.height * main->panel.width, sizeof *main->codes);
  if (main->codes == NULL) {
    clt_log(CLT_LOG_ERROR, "no memory for a picture of %d x %d; the last one stays up", main->panel.width,
            main->panel.height);
    return;
  }
  output_encode(main->drive, &main->panel, main->codes);
}

static void report_opened(output *main, const clt_error *error) {
  output_opened *letter = clt_alloc(1, sizeof *letter);
  if (letter == NULL) {
    return;
  }
  letter->error = *error;
  letter->station = &main->station;
  if (main->open) {
    letter->projector = main->panel;
    snprintf(letter->projector_name, sizeof letter->projector_name, "%s", main->station.projector->driver->name);
    letter->panel = main->known;
  }
  daemon_report(main->boxes, main->boxes->opened, letter);
}

static void open_projector(output *main, const clt_station_config *config) {
  clt_error error = {0};
  main->begun = main->begun || clt_station_begin(config, &main->station, &error) == CLT_OK;
  if (!main->open && main->begun && clt_station_open_projector(config, &main->station, &error) == CLT_OK) {
    main->open = true;
    free(main->moving_codes);
    main->moving_codes = NULL;
    main->station.projector->driver->describe(main->station.projector, &main->panel);
    main->known = clt_station_rig_config(config, &main->station).projector;
    encode_drive(main);
  }
  report_opened(main, &error);
}

/* A projector that takes no picture any more is closed and reported, once. */
static void lose_projector(output *main, const clt_error *cause) {
  clt_error error = {0};
  clt_fail(&error, CLT_GONE, "the projector takes no picture: %.400s", cause->message);
  clt_station_close_projector(&main->station);
  main->open = main->measuring = false;
  free(main->codes);
  main->codes = NULL;
  report_opened(main, &error);
}

static void obey(output *main) {
  output_order *order = clt_mailbox_take(main->boxes->orders, 0);
  if (order == NULL) {
    return;
  }
  if (order->kind == OUTPUT_STOP) {
    main->stopping = true;
  } else {
    open_projector(main, &order->station);
  }
  free(order);
}

static void take_drive(output *main) {
  output_drive *newer = clt_mailbox_take(main->boxes->drives, 0);
  if (newer != NULL) {
    output_drive_free(main->drive);
    main->drive = newer;
    encode_drive(main);
  }
}

static double refresh_of(const output *main) {
  return main->open && main->panel.refresh_s > 0 ? main->panel.refresh_s : idle_refresh_s;
}

static bool is_moving(const output *main) {
  return main->moving != NULL && (main->drive == NULL || main->moving->serial >= main->drive->serial);
}

static clt_status present(output *main, const float *codes, int64_t *shown_ns, clt_error *error) {
  clt_projector *projector = main->station.projector;
  if (!main->open) {
    return clt_fail(error, CLT_FAILED, "the projector is not open");
  }
  clt_status status = projector->driver->present(projector, codes, shown_ns, error);
  main->frames.presented += status == CLT_OK;
  return status;
}

/* Shows a pattern at once and answers; or ends measuring, so that the drive is up again in this very turn. To measure,
 * CLT_GONE means its camera. */
static void take_pattern(output *main, output_pattern *pattern) {
  output_answer *answer = pattern->codes != NULL ? clt_alloc(1, sizeof *answer) : NULL;
  bool lost = false;
  clt_error cause = {0};
  main->measuring = pattern->codes != NULL;
  if (answer != NULL) {
    if (present(main, pattern->codes, &answer->shown_ns, &answer->error) != CLT_OK) {
      answer->error.status = CLT_FAILED;
      lost = main->open;
      cause = answer->error;
    }
    clt_mailbox_put(main->boxes->answers, answer);
  }
  output_pattern_free(pattern);
  if (lost) {
    lose_projector(main, &cause);
  }
}

/* By the projector itself, else encoded and dithered here. Every refresh has a dither of its own. */
static clt_status present_moving(output *main, int64_t *shown_ns, clt_error *error) {
  clt_projector *projector = main->station.projector;
  clt_live_picture *picture = &main->moving->picture;
  const clt_projector_info *panel = &main->panel;
  size_t count = (size_t)panel->channels * (size_t)panel->height * (size_t)panel->width;
  picture->seed = (uint32_t)main->frames.presented;
  if (projector->driver->present_live != NULL) {
    clt_status status = projector->driver->present_live(projector, picture, shown_ns, error);
    main->frames.presented += status == CLT_OK;
    return status;
  }
  main->moving_codes = main->moving_codes != NULL ? main->moving_codes : clt_alloc(count, sizeof(float));
  if (main->moving_codes == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for a picture of %d x %d", panel->width, panel->height);
  }
  clt_status status = clt_live_encode(picture, panel->channels, panel->height, panel->width, main->moving_codes, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_live_dither(main->moving_codes, count, panel->bits, picture->seed);
  return present(main, main->moving_codes, shown_ns, error);
}

/* False where there is nothing to show, or a pattern stays up. */
static bool show_picture(output *main) {
  int64_t shown_ns;
  clt_error error = {0};
  bool moves = is_moving(main);
  if (main->measuring || !main->open || (main->codes == NULL && !moves)) {
    return false;
  }
  if (moves) {
    rank_begin(&main->work, main->moving->beside ? main->work.all / 2 : 0, refresh_of(main));
  }
  rank_keep(&main->place, moves && main->work.taken < main->work.all ? RANK_ASIDE : RANK_ALL);
  clt_status status = moves ? present_moving(main, &shown_ns, &error) : present(main, main->codes, &shown_ns, &error);
  if (moves) {
    rank_end(&main->work);
  }
  if (status == CLT_OK) {
    main->frames.picture = true;
  } else {
    lose_projector(main, &error);
  }
  return status == CLT_OK;
}

/* Reports now and then, and at once when the first picture is up. */
static void report_frames(output *main) {
  double passed = clt_clock_since(main->reported_ns);
  bool due = passed >= report_s || main->frames.picture != main->reported.picture;
  output_frames *letter = due ? clt_alloc(1, sizeof *letter) : NULL;
  if (letter == NULL) {
    return;
  }
  main->frames.fps = (double)(main->frames.presented - main->reported.presented) / passed;
  main->reported = main->frames;
  main->reported_ns = clt_clock_ns();
  *letter = main->frames;
  daemon_report(main->boxes, main->boxes->frames, letter);
}

static void turn(output *main) {
  const double late_part = 1.5, refresh_s = refresh_of(main);
  pace_begin(&main->pace, clt_clock_ns(), refresh_s);
  obey(main);
  take_drive(main);
  reel_take(main->boxes->reel, main->pace.at_ns, refresh_s, &main->moving);
  const bool waited = show_picture(main) && main->panel.waits;
  main->frames.turns++;
  report_frames(main);
  main->frames.late += clt_clock_since(main->pace.begun_ns) > late_part * refresh_s;
  const double left_s = pace_left(&main->pace, clt_clock_ns(), refresh_s, waited);
  output_pattern *pattern = clt_mailbox_take(main->boxes->patterns, left_s);
  if (pattern != NULL) {
    take_pattern(main, pattern);
  }
}

void output_run(output *main) {
  main->work = rank_open();
  main->place = rank_stand();
  rank_before(RANK_FIRST);
  rank_take_turns(RANK_REFRESH);
  while (!main->stopping) {
    turn(main);
  }
}
