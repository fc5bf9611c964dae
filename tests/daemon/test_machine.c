#include "daemon/machine.h"
#include "support.h"

static bool is_request(machine_event event) {
  return event == EVENT_REACQUIRE || event == EVENT_PICTURE || event == EVENT_HOLD || event == EVENT_RESUME;
}

static void every_state_and_event_has_a_result(void **state) {
  (void)state;
  for (machine_state from = 0; from < STATE_COUNT; from++) {
    for (machine_event event = 0; event < EVENT_COUNT; event++) {
      machine_transition to = machine_step(from, event);
      assert_true(to.next < STATE_COUNT);
      assert_true(to.action > ACTION_UNDEFINED && to.action < ACTION_COUNT);
      if (to.action == ACTION_IGNORE || to.action == ACTION_REFUSE) {
        assert_int_equal(to.next, from);
      }
      if (is_request(event)) {
        assert_int_not_equal(to.action, ACTION_IGNORE); /* whoever asks is told */
      } else {
        assert_int_not_equal(to.action, ACTION_REFUSE);
      }
    }
  }
}

static void stopping_is_reached_from_everywhere_and_never_left(void **state) {
  (void)state;
  for (machine_state from = 0; from < STATE_COUNT; from++) {
    assert_int_equal(machine_step(from, EVENT_STOP).next, STATE_STOPPING);
  }
  for (machine_event event = 0; event < EVENT_COUNT; event++) {
    assert_int_equal(machine_step(STATE_STOPPING, event).next, STATE_STOPPING);
  }
}

/* What the designers of an exhibit rely on, written down a second time. */
static void the_ways_through_are_those_of_the_design(void **state) {
  (void)state;
  static const struct {
    machine_state from;
    machine_event event;
    machine_state next;
    machine_action action;
  } ways[] = {
      {STATE_OPENING, EVENT_OPENED, STATE_CALIBRATING, ACTION_BEGIN},
      {STATE_CALIBRATING, EVENT_CALIBRATED, STATE_CALIBRATING, ACTION_LOAD},
      {STATE_CALIBRATING, EVENT_LOADED, STATE_SOLVING, ACTION_SOLVE},
      {STATE_ACQUIRING, EVENT_LOADED, STATE_SOLVING, ACTION_SOLVE}, /* nothing changed */
      {STATE_CALIBRATING, EVENT_UNKNOWN, STATE_ACQUIRING, ACTION_ACQUIRE},
      {STATE_ACQUIRING, EVENT_ACQUIRED, STATE_SOLVING, ACTION_ADOPT},
      {STATE_SOLVING, EVENT_SOLVED, STATE_SHOWING, ACTION_SHOW},
      {STATE_SOLVING, EVENT_UNSOLVED, STATE_HOLDING, ACTION_BACK_OFF},
      {STATE_SHOWING, EVENT_VERIFY, STATE_VERIFYING, ACTION_VERIFY},
      {STATE_VERIFYING, EVENT_VERIFIED, STATE_SHOWING, ACTION_NOTE},
      {STATE_VERIFYING, EVENT_CHANGED, STATE_ACQUIRING, ACTION_ACQUIRE},
      {STATE_SHOWING, EVENT_REACQUIRE, STATE_ACQUIRING, ACTION_ACQUIRE},
      {STATE_SHOWING, EVENT_OWED, STATE_ACQUIRING, ACTION_ACQUIRE},
      {STATE_HOLDING, EVENT_OWED, STATE_HOLDING, ACTION_IGNORE},
      {STATE_ACQUIRING, EVENT_REACQUIRE, STATE_ACQUIRING, ACTION_REFUSE},
      {STATE_ACQUIRING, EVENT_HOLD, STATE_HOLDING, ACTION_FREEZE},
      {STATE_HOLDING, EVENT_RESUME, STATE_OPENING, ACTION_OPEN},
      {STATE_HOLDING, EVENT_RETRY, STATE_OPENING, ACTION_OPEN},
      {STATE_SHOWING, EVENT_RESUME, STATE_SHOWING, ACTION_REFUSE},
      {STATE_HOLDING, EVENT_ACQUIRED, STATE_HOLDING, ACTION_IGNORE},
  };
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
    machine_transition to = machine_step(ways[i].from, ways[i].event);
    if (to.next != ways[i].next || to.action != ways[i].action) {
      fail_msg("%s + %s gave %s / %s", machine_state_name(ways[i].from), machine_event_name(ways[i].event),
               machine_state_name(to.next), machine_action_name(to.action));
    }
  }
}

/* With the devices open a picture is on its way or up, whatever happens in whatever order: the only way out of
 * `opening` that is no failure puts one up, and no action takes one away. */
static void no_walk_reaches_a_state_without_a_picture(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 200; seed++) {
    uint64_t random = seed;
    machine_state at = STATE_OPENING;
    bool open = false, picture = false;
    for (int step = 0; step < 400 && at != STATE_STOPPING; step++) {
      machine_event event = (machine_event)(test_random(&random) * EVENT_COUNT);
      if (event == EVENT_STOP && test_random(&random) < 0.95) {
        continue;
      }
      /* The drive exists only where the devices were open before: control does not solve without them. */
      if (event == EVENT_SOLVED && !open) {
        continue;
      }
      open = open || event == EVENT_OPENED;
      machine_transition to = machine_step(at, event);
      picture = picture || machine_action_shows(to.action);
      at = to.next;
      assert_true(at < STATE_COUNT);
      bool exempt = at == STATE_OPENING || at == STATE_STOPPING || (at == STATE_HOLDING && !open);
      if (!exempt && !picture) {
        fail_msg("seed %lu: %s without a picture", (unsigned long)seed, machine_state_name(at));
      }
    }
  }
}

/* From every state there is a way back to showing, by events that come by themselves (no request needed), except where
 * a person asked to hold. */
static void every_failure_leads_back_to_showing(void **state) {
  (void)state;
  bool reaches[STATE_COUNT] = {[STATE_SHOWING] = true};
  for (int round = 0; round < STATE_COUNT; round++) {
    for (machine_state from = 0; from < STATE_COUNT; from++) {
      for (machine_event event = 0; event < EVENT_COUNT; event++) {
        reaches[from] = reaches[from] || (!is_request(event) && reaches[machine_step(from, event).next]);
      }
    }
  }
  for (machine_state from = 0; from < STATE_COUNT; from++) {
    assert_int_equal(reaches[from], from != STATE_STOPPING);
  }
}

static void back_off_doubles_up_to_its_limit(void **state) {
  (void)state;
  static const double wanted[] = {1, 2, 4, 8, 16, 32, 60, 60};
  for (int i = 0; i < 8; i++) {
    assert_near(machine_back_off(i, 1, 60), wanted[i], 0);
  }
  assert_near(machine_back_off(1000000000, 0.5, 7), 7, 0);
  assert_near(machine_back_off(0, 5, 5), 5, 0);
}

static void names_lead_back_to_states(void **state) {
  (void)state;
  for (machine_state at = 0; at < STATE_COUNT; at++) {
    assert_int_equal(machine_state_named(machine_state_name(at)), at);
  }
  assert_int_equal(machine_state_named("resting"), STATE_COUNT);
}

static void the_graph_names_every_state_and_each_change_once(void **state) {
  (void)state;
  char *text = NULL;
  size_t size = 0;
  FILE *out = open_memstream(&text, &size);
  assert_non_null(out);
  machine_print(out);
  fclose(out);
  assert_int_equal(strncmp(text, "digraph counterlightd {\n", 24), 0);
  assert_string_equal(text + size - 2, "}\n");
  assert_non_null(strstr(text, "  verifying -> showing [label=\"verified / note\"];\n"));
  for (machine_state at = 0; at < STATE_COUNT; at++) {
    assert_non_null(strstr(text, machine_state_name(at)));
  }
  int lines = 0, wanted = 4;
  for (size_t i = 0; i < size; i++) {
    lines += text[i] == '\n';
  }
  for (machine_state from = 0; from < STATE_COUNT; from++) {
    for (machine_event event = 0; event < EVENT_COUNT; event++) {
      wanted += machine_step(from, event).action > ACTION_REFUSE;
    }
  }
  assert_int_equal(lines, wanted);
  free(text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_state_and_event_has_a_result),
      cmocka_unit_test(stopping_is_reached_from_everywhere_and_never_left),
      cmocka_unit_test(the_ways_through_are_those_of_the_design),
      cmocka_unit_test(no_walk_reaches_a_state_without_a_picture),
      cmocka_unit_test(every_failure_leads_back_to_showing),
      cmocka_unit_test(back_off_doubles_up_to_its_limit),
      cmocka_unit_test(names_lead_back_to_states),
      cmocka_unit_test(the_graph_names_every_state_and_each_change_once),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
