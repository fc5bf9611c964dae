#include "daemon/machine.h"

#include <string.h>

static const char *const state_names[STATE_COUNT] = {
    [STATE_OPENING] = "opening", [STATE_CALIBRATING] = "calibrating", [STATE_ACQUIRING] = "acquiring",
    [STATE_SOLVING] = "solving", [STATE_SHOWING] = "showing",         [STATE_VERIFYING] = "verifying",
    [STATE_HOLDING] = "holding", [STATE_STOPPING] = "stopping",
};

static const char *const event_names[EVENT_COUNT] = {
    [EVENT_OPENED] = "opened",       [EVENT_CALIBRATED] = "calibrated",
    [EVENT_LOADED] = "loaded",       [EVENT_UNKNOWN] = "unknown",
    [EVENT_ACQUIRED] = "acquired",   [EVENT_SOLVED] = "solved",
    [EVENT_UNSOLVED] = "unsolved",   [EVENT_VERIFIED] = "verified",
    [EVENT_OWED] = "owed",           [EVENT_CHANGED] = "changed",
    [EVENT_FAILED] = "failed",       [EVENT_LOST] = "lost",
    [EVENT_VERIFY] = "verify",       [EVENT_RETRY] = "retry",
    [EVENT_REACQUIRE] = "reacquire", [EVENT_PICTURE] = "picture",
    [EVENT_HOLD] = "hold",           [EVENT_RESUME] = "resume",
    [EVENT_STOP] = "stop",
};

static const char *const action_names[ACTION_COUNT] = {
    [ACTION_UNDEFINED] = "undefined", [ACTION_IGNORE] = "ignore",     [ACTION_REFUSE] = "refuse",
    [ACTION_OPEN] = "open",           [ACTION_BEGIN] = "begin",       [ACTION_PREPARE] = "prepare",
    [ACTION_LOAD] = "load",           [ACTION_ACQUIRE] = "acquire",   [ACTION_ADOPT] = "adopt",
    [ACTION_SOLVE] = "solve",         [ACTION_SHOW] = "show",         [ACTION_VERIFY] = "verify",
    [ACTION_NOTE] = "note",           [ACTION_BACK_OFF] = "back off", [ACTION_FREEZE] = "freeze",
    [ACTION_STOP] = "stop",
};

/* What is left out is ignored: answers that come late (a verification that ends after someone asked to hold) and timers
 * that no longer matter. A request is never left out; it is done or refused. */
static const machine_transition table[STATE_COUNT][EVENT_COUNT] =
    {
        [STATE_OPENING] =
            {
                [EVENT_OPENED] = {STATE_CALIBRATING, ACTION_BEGIN},
                [EVENT_SOLVED] = {STATE_OPENING, ACTION_SHOW},
                [EVENT_FAILED] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_REACQUIRE] = {STATE_OPENING, ACTION_REFUSE},
                [EVENT_PICTURE] = {STATE_OPENING, ACTION_PREPARE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_OPENING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_CALIBRATING] =
            {
                [EVENT_CALIBRATED] = {STATE_CALIBRATING, ACTION_LOAD},
                [EVENT_LOADED] = {STATE_SOLVING, ACTION_SOLVE},
                [EVENT_UNKNOWN] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_SOLVED] = {STATE_CALIBRATING, ACTION_SHOW},
                [EVENT_FAILED] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_REACQUIRE] = {STATE_CALIBRATING, ACTION_REFUSE},
                [EVENT_PICTURE] = {STATE_CALIBRATING, ACTION_PREPARE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_CALIBRATING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_ACQUIRING] =
            {
                [EVENT_ACQUIRED] = {STATE_SOLVING, ACTION_ADOPT},
                [EVENT_LOADED] = {STATE_SOLVING, ACTION_SOLVE},
                [EVENT_SOLVED] = {STATE_ACQUIRING, ACTION_SHOW},
                [EVENT_FAILED] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_REACQUIRE] = {STATE_ACQUIRING, ACTION_REFUSE},
                [EVENT_PICTURE] = {STATE_ACQUIRING, ACTION_SOLVE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_ACQUIRING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_SOLVING] =
            {
                [EVENT_SOLVED] = {STATE_SHOWING, ACTION_SHOW},
                [EVENT_UNSOLVED] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_REACQUIRE] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_PICTURE] = {STATE_SOLVING, ACTION_SOLVE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_SOLVING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_SHOWING] =
            {
                [EVENT_SOLVED] = {STATE_SHOWING, ACTION_SHOW},
                [EVENT_OWED] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_VERIFY] = {STATE_VERIFYING, ACTION_VERIFY},
                [EVENT_REACQUIRE] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_PICTURE] = {STATE_SOLVING, ACTION_SOLVE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_SHOWING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_VERIFYING] =
            {
                [EVENT_SOLVED] = {STATE_VERIFYING, ACTION_SHOW},
                [EVENT_VERIFIED] = {STATE_SHOWING, ACTION_NOTE},
                [EVENT_CHANGED] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_FAILED] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_REACQUIRE] = {STATE_ACQUIRING, ACTION_ACQUIRE},
                [EVENT_PICTURE] = {STATE_SOLVING, ACTION_SOLVE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_VERIFYING, ACTION_REFUSE},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_HOLDING] =
            {
                [EVENT_OPENED] = {STATE_HOLDING, ACTION_PREPARE},
                [EVENT_SOLVED] = {STATE_HOLDING, ACTION_SHOW},
                [EVENT_LOST] = {STATE_HOLDING, ACTION_BACK_OFF},
                [EVENT_RETRY] = {STATE_OPENING, ACTION_OPEN},
                [EVENT_REACQUIRE] = {STATE_OPENING, ACTION_OPEN},
                [EVENT_PICTURE] = {STATE_HOLDING, ACTION_SOLVE},
                [EVENT_HOLD] = {STATE_HOLDING, ACTION_FREEZE},
                [EVENT_RESUME] = {STATE_OPENING, ACTION_OPEN},
                [EVENT_STOP] = {STATE_STOPPING, ACTION_STOP},
            },
        [STATE_STOPPING] =
            {
                [EVENT_REACQUIRE] = {STATE_STOPPING, ACTION_REFUSE},
                [EVENT_PICTURE] = {STATE_STOPPING, ACTION_REFUSE},
                [EVENT_HOLD] = {STATE_STOPPING, ACTION_REFUSE},
                [EVENT_RESUME] = {STATE_STOPPING, ACTION_REFUSE},
            },
};

machine_transition machine_step(machine_state state, machine_event event) {
  machine_transition transition = table[state][event];
  return transition.action != ACTION_UNDEFINED ? transition : (machine_transition){state, ACTION_IGNORE};
}

bool machine_action_shows(machine_action action) {
  return action == ACTION_BEGIN || action == ACTION_PREPARE || action == ACTION_SHOW;
}

const char *machine_state_name(machine_state state) {
  return state_names[state];
}

const char *machine_event_name(machine_event event) {
  return event_names[event];
}

const char *machine_action_name(machine_action action) {
  return action_names[action];
}

machine_state machine_state_named(const char *name) {
  machine_state state = 0;
  while (state < STATE_COUNT && strcmp(state_names[state], name) != 0) {
    state++;
  }
  return state;
}

double machine_back_off(int attempt, double least_s, double most_s) {
  double wait = least_s;
  for (int i = 0; i < attempt && wait < most_s; i++) {
    wait *= 2;
  }
  return wait < most_s ? wait : most_s;
}

void machine_print(FILE *out) {
  fputs("digraph counterlightd {\n  rankdir=LR;\n  node [shape=box, style=rounded];\n", out);
  for (machine_state state = 0; state < STATE_COUNT; state++) {
    for (machine_event event = 0; event < EVENT_COUNT; event++) {
      machine_transition transition = table[state][event];
      if (transition.action > ACTION_REFUSE) {
        fprintf(out, "  %s -> %s [label=\"%s / %s\"];\n", state_names[state], state_names[transition.next],
                event_names[event], action_names[transition.action]);
      }
    }
  }
  fputs("}\n", out);
}
