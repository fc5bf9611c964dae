/* The daemon's state machine: one constant table, no input or output. */
#ifndef CLT_DAEMON_MACHINE_H
#define CLT_DAEMON_MACHINE_H

#include <stdbool.h>
#include <stdio.h>

typedef enum machine_state {
  STATE_OPENING,     /* the projector is being opened */
  STATE_CALIBRATING, /* camera and rig are being made ready, then a stored transport looked for */
  STATE_ACQUIRING,   /* the transport is being measured */
  STATE_SOLVING,     /* the drive is being computed from a transport in hand */
  STATE_SHOWING,     /* the compensated picture is up and nothing else goes on */
  STATE_VERIFYING,   /* the picture is up and being photographed */
  STATE_HOLDING,     /* a step failed or a person asked: the last good picture stays up */
  STATE_STOPPING,
  STATE_COUNT
} machine_state;

typedef enum machine_event {
  EVENT_OPENED,     /* the projector is open */
  EVENT_CALIBRATED, /* camera and rig are ready: grid and response are known */
  EVENT_LOADED,     /* a transport that fits is in hand */
  EVENT_UNKNOWN,    /* there is none, or the configuration wants a new one */
  EVENT_ACQUIRED,   /* a new transport was measured */
  EVENT_SOLVED,     /* a drive was computed */
  EVENT_UNSOLVED,   /* it could not be */
  EVENT_VERIFIED,   /* the picture was photographed and is as predicted */
  EVENT_OWED,       /* an acquisition that was interrupted by the end of an earlier run is to go on */
  EVENT_CHANGED,    /* the picture is further off than the configuration allows: the room has changed */
  EVENT_FAILED,     /* opening, calibrating or measuring failed */
  EVENT_LOST,       /* the projector is gone */
  EVENT_VERIFY,     /* time to verify */
  EVENT_RETRY,      /* the back-off has passed */
  EVENT_REACQUIRE,  /* asked for: a new transport */
  EVENT_PICTURE,    /* asked for: other content, already decoded */
  EVENT_HOLD,       /* asked for: leave everything as it is */
  EVENT_RESUME,     /* asked for: go on */
  EVENT_STOP,       /* SIGTERM or SIGINT */
  EVENT_COUNT
} machine_event;

typedef enum machine_action {
  ACTION_UNDEFINED, /* an entry that the table leaves out; machine_step never gives it */
  ACTION_IGNORE,    /* the event means nothing here */
  ACTION_REFUSE,    /* whoever asked is told that it cannot be done in this state */
  ACTION_OPEN,      /* open the projector, where it is not */
  ACTION_BEGIN,     /* put up the last drive, or the uncompensated picture; open the camera, make the rig ready */
  ACTION_PREPARE,   /* put up the uncompensated picture until there is something better */
  ACTION_LOAD,      /* look for a stored transport */
  ACTION_ACQUIRE,   /* measure a new transport; a running verification is given up */
  ACTION_ADOPT,     /* certify and store the new transport, and solve with it */
  ACTION_SOLVE,     /* compute the drive for the content */
  ACTION_SHOW,      /* put up the drive that was computed */
  ACTION_VERIFY,    /* photograph the picture and compare */
  ACTION_NOTE,      /* keep what was found for the status */
  ACTION_BACK_OFF,  /* leave the picture up, give up running measurements, try again later */
  ACTION_FREEZE,    /* the same without trying again */
  ACTION_STOP,
  ACTION_COUNT
} machine_action;

typedef struct machine_transition {
  machine_state next;
  machine_action action;
} machine_transition;

/* What an event does in a state; both in range. */
machine_transition machine_step(machine_state state, machine_event event);
/* True where the action puts a picture on the glass. No action takes one away. */
bool machine_action_shows(machine_action action);

const char *machine_state_name(machine_state state);
const char *machine_event_name(machine_event event);
const char *machine_action_name(machine_action action);
/* The state called name, or STATE_COUNT. */
machine_state machine_state_named(const char *name);

/* Seconds to wait before try number attempt (0, 1, ...): least doubled each time, at most most. */
double machine_back_off(int attempt, double least_s, double most_s);

/* The table as a Graphviz digraph; refused and ignored events are left out. */
void machine_print(FILE *out);

#endif
