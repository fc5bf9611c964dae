/* What photographs of the picture and of the room say, and what follows. */
#include <math.h>

#include "base/clock.h"
#include "base/log.h"
#include "daemon/control.h"

/* A slope counts where it is so many standard deviations beyond the limit. */
static const double DEVIATIONS = 3;

static void tell_verification(control *self) {
  const control_findings *found = &self->found;
  clt_log(CLT_LOG_INFO, "verified: the picture is %.2f %% off, %.2f %% was predicted", 100 * found->verified_error,
          100 * found->picture.compensation.error_after);
  if (found->checked) {
    clt_log(found->fit.fits ? CLT_LOG_INFO : CLT_LOG_WARNING,
            "the photograph is %.2f %% off what T predicts, up to %.2f %% is its noise and T's own error: %s",
            100 * found->fit.off, 100 * found->fit.limit, found->fit.fits ? "T fits" : "T no longer fits the room");
  }
  server_notify(self->service, "verify", control_verify_note(self));
}

/* Says once that something drifts faster than the configuration allows, as far as the scatter lets one tell. */
static void follow_drift(control *self, const measure_result *letter) {
  control_findings *found = &self->found;
  double limit = self->config.drift_limit;
  trend_slopes slopes;
  if (!letter->checked) {
    return;
  }
  trend_add(&found->trend, (double)clt_clock_ns() * 1e-9, letter->verified_error, letter->brightness);
  bool known = limit > 0 && trend_measure(&found->trend, &slopes);
  bool fast = known && (fmax(slopes.error - DEVIATIONS * slopes.error_deviation,
                             fabs(slopes.brightness) - DEVIATIONS * slopes.brightness_deviation) > limit);
  if (fast && !found->drifts) {
    clt_log(CLT_LOG_WARNING,
            "drift: in an hour the error grows by %.3g %% and the light changes by %.3g %% of what T predicts; "
            "\"drift_limit\" is %.3g %%",
            100 * slopes.error, 100 * slopes.brightness, 100 * limit);
  }
  bool turned = fast != found->drifts;
  found->drifts = fast;
  if (turned) {
    server_notify(self->service, "drift", control_drift_note(self));
  }
}

static void take_photograph(control *self, measure_result *letter) {
  clt_image_finish(&self->found.observation);
  self->found.observation = letter->observation;
  letter->observation = (clt_image){0};
  self->found.verified_error = letter->verified_error;
  self->found.verified = time(NULL);
}

/* The refined drive goes up. Whether T fits was told by the photograph before. */
void control_on_refinement(control *self, measure_result *letter) {
  control_findings *found = &self->found;
  take_photograph(self, letter);
  found->refined = letter->refined;
  clt_image_finish(&found->picture.drive);
  found->picture.drive = letter->drive;
  letter->drive = (clt_image){0};
  control_act(self, ACTION_SHOW);
  clt_log(CLT_LOG_NOTICE,
          "refined: the picture was %.2f %% off and is %.2f %%, by %d photographs, whose noise is %.2f %%",
          100 * letter->refined.before, 100 * letter->refined.after, letter->refined.photographs,
          100 * letter->refined.noise);
  server_notify(self->service, "verify", control_verify_note(self));
  control_event(self, EVENT_VERIFIED);
}

static void refine_or(control *self, bool misfit, machine_event event) {
  bool wanted = self->wishes.refine || (misfit && self->config.on_misfit == MISFIT_REFINE);
  self->wishes.refine = false;
  if (wanted && event == EVENT_VERIFIED && self->state == STATE_VERIFYING && self->found.model != NULL) {
    control_measure(self, MEASURE_REFINE);
  } else {
    control_event(self, event);
  }
}

void control_on_verification(control *self, measure_result *letter) {
  take_photograph(self, letter);
  self->found.checked = letter->checked;
  self->found.fit = letter->fit;
  tell_verification(self);
  follow_drift(self, letter);
  bool misfit = letter->checked && !letter->fit.fits;
  bool changed = (self->config.reacquire_error > 0 && letter->verified_error > self->config.reacquire_error) ||
                 (misfit && self->config.on_misfit == MISFIT_REACQUIRE);
  self->wishes.scope = changed && !self->wishes.acquire ? MEASURE_CHANGED : self->wishes.scope;
  self->wishes.acquire = self->wishes.acquire || changed;
  refine_or(self, misfit, changed ? EVENT_CHANGED : EVENT_VERIFIED);
}

static void tell_geometry(const geometry_renewal *geometry) {
  if (geometry->adopted) {
    clt_log(CLT_LOG_NOTICE, "the geometry is new: the camera moved by %.2f of its pixels and sees %.1f %% of the panel",
            geometry->moved, 100 * geometry->covered);
  } else if (geometry->measured) {
    clt_log(CLT_LOG_WARNING, "the earlier geometry stays: %s", geometry->why);
  }
}

/* A transport to adopt, or the one in use fits and is solved with again. */
void control_on_renewal(control *self, const measure_result *letter) {
  static const char *const texts[] = {[RENEW_NONE] = "measured",
                                      [RENEW_FITS] = "nothing changed",
                                      [RENEW_GAIN] = "black and gain are new",
                                      [RENEW_REPAINT] = "rows of repainted cells are new",
                                      [RENEW_MEASURE] = "all of it was measured"};
  const renewal *renewed = &letter->renewed;
  self->found.renewed = *renewed;
  tell_geometry(&renewed->geometry);
  if (renewed->outcome != RENEW_NONE) {
    clt_log(CLT_LOG_NOTICE, "the transport was %.2f %% off where %.2f %% fits: %s, by %d patterns",
            100 * renewed->before.off, 100 * renewed->before.limit, texts[renewed->outcome], renewed->patterns);
  }
  server_notify(self->service, "reacquired", control_renewed_note(self));
  if (letter->transport == NULL) {
    self->wishes.acquire = false;
  }
}
