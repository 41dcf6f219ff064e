/* A machine as an instance with numbers, inputs and a state: what both FMI versions share. Follows the model, integrator.c and the
   tables of the variables. Value references: time, NU inputs, NY outputs, NX states, NA inner quantities, NP parameters, NS of the
   start, the last of which is a Boolean. */

#include <stdio.h>
#include <stdlib.h>

enum { INPUTS = 1, MEASURED = INPUTS + NU, STATES = MEASURED + NY, INNER = STATES + NX, NUMBERS = INNER + NA, START = NUMBERS + NP,
       ALL = START + NS };

typedef enum { INSTANTIATED, INITIALISING, STEPPING, OVER } stage_t;

/* The inputs, which are held, and the time from which on they were given. */
typedef struct { double from, u[NU]; } given_t;

/* The model up to a time, with the step size that suited last. */
typedef struct { double time, h, x[NX]; } course_t;

typedef struct {
  double p[NP], start[NS], u[NU], c[NC], minimum[NX], maximum[NX];
  double begin, tolerance;
  course_t present, late; /* late: as far as delayed sensors show */
  given_t *given;
  long n_given, room;
  int stale; /* numbers or start have changed since c and the states were computed */
  stage_t stage;
  char message[256];
} machine_t;

static double delay(const machine_t *m, const int *which) {
  double sum = 0.0;
  for (; *which >= 0; which++) sum += m->p[*which];
  return sum;
}

static void restore_defaults(machine_t *m) {
  memcpy(m->p, P_START, sizeof m->p);
  memcpy(m->start, START_START, sizeof m->start);
  memcpy(m->u, U_START, sizeof m->u);
  m->begin = 0.0;
  m->tolerance = TOLERANCE;
  m->n_given = 0;
  m->stale = 1;
  m->stage = INSTANTIATED;
}

static machine_t *new_machine(void) {
  machine_t *m = (machine_t *)calloc(1, sizeof(machine_t));
  if (m) restore_defaults(m);
  return m;
}

static void free_machine(machine_t *m) {
  if (m) free(m->given);
  free(m);
}

/* Copies everything; 0 without memory. */
static int copy_machine(machine_t *to, const machine_t *from) {
  given_t *given = NULL;
  if (from->n_given) {
    given = (given_t *)malloc((size_t)from->n_given * sizeof(given_t));
    if (!given) return 0;
    memcpy(given, from->given, (size_t)from->n_given * sizeof(given_t));
  }
  free(to->given);
  *to = *from;
  to->given = given;
  to->room = from->n_given;
  return 1;
}

/* Constants, limits and, before the first step, the state at rest from numbers and start. */
static void refresh(machine_t *m) {
  if (!m->stale) return;
  m->stale = 0;
  model_prepare(m->p, m->c);
  for (int i = 0; i < NX; i++) {
    const double stroke = LARGEST_SPOOL * m->p[SPOOL_STROKE];
    m->minimum[i] = IS_SPOOL[i] ? -stroke : X_MINIMUM[i];
    m->maximum[i] = IS_SPOOL[i] ? stroke : X_MAXIMUM[i];
  }
  if (m->stage > INITIALISING) return;
  m->present.time = m->begin;
  m->present.h = FIRST_STEP;
  model_rest(m->start, m->u, m->c, m->present.x);
  if (ELAPSED >= 0) m->present.x[ELAPSED] = m->begin;
  m->late = m->present;
}

/* Inputs from a time on; 0 without memory. */
static int give(machine_t *m, double from) {
  if (m->n_given && !memcmp(m->given[m->n_given - 1].u, m->u, sizeof m->u)) return 1;
  if (m->n_given == m->room) {
    const long room = m->room ? 2 * m->room : 16;
    given_t *given = (given_t *)realloc(m->given, (size_t)room * sizeof(given_t));
    if (!given) return 0;
    m->given = given;
    m->room = room;
  }
  m->given[m->n_given].from = from;
  memcpy(m->given[m->n_given].u, m->u, sizeof m->u);
  m->n_given++;
  return 1;
}

/* Which of the given inputs act at a time; before the first ones these. */
static long acting(const machine_t *m, double time) {
  long k = m->n_given - 1;
  while (k > 0 && m->given[k].from > time + COINCIDENT) k--;
  return k;
}

static int advance(machine_t *m, course_t *course, double until, double dead_time) {
  run_t run = {X_SCALE, m->minimum, m->maximum, m->tolerance, 0, 0, 0, 0, 0.0, -1, 0.0, 0, 0, 0};
  const int order = m->tolerance > ORDER_3_ABOVE ? 3 : 4;
  long next = 0;
  while (course->time < until) {
    const long k = acting(m, course->time - dead_time);
    double end = until;
    if (k + 1 < m->n_given && m->given[k + 1].from + dead_time < until) end = m->given[k + 1].from + dead_time;
    const int status = interval(order, &run, course->x, m->given[k].u, m->c, course->time, end, &course->h, 0, 0, &next, 0, 0);
    if (status == LEFT_RANGE)
      snprintf(m->message, sizeof m->message, "at %.3f s %s left its range of %g .. %g %s", run.time, X_NAMES[run.state],
               m->minimum[run.state], m->maximum[run.state], X_UNITS[run.state]);
    else if (status != OK)
      snprintf(m->message, sizeof m->message, "at %.3f s the step size vanished: the equations have no solution there", run.time);
    if (status != OK) return 0;
    course->time = end;
  }
  return 1;
}

/* One communication step; 0 with a message where it fails. */
static int step_machine(machine_t *m, double from, double length) {
  const double until = from + length, command = delay(m, COMMAND_DELAYS), sensors = delay(m, PRESSURE_DELAYS);
  if (m->stage != STEPPING) {
    snprintf(m->message, sizeof m->message, "a step is possible after the initialisation and before the end or an error");
    return 0;
  }
  if (!(length > 0.0) || !(fabs(from - m->present.time) <= 1e-6 * length + COINCIDENT)) {
    snprintf(m->message, sizeof m->message, "a step of %g s from %.9g s: it has to go on from %.9g s", length, from, m->present.time);
    return 0;
  }
  refresh(m);
  if (!give(m, from)) {
    snprintf(m->message, sizeof m->message, "no memory");
    return 0;
  }
  if (!advance(m, &m->present, until, command) || (sensors > 0.0 && !advance(m, &m->late, until - sensors, command))) {
    m->stage = OVER;
    return 0;
  }
  m->present.time = until;
  /* inputs that neither course will ask for again */
  const long first = acting(m, (sensors > 0.0 ? m->late.time : until) - command);
  if (first > 0) {
    m->n_given -= first;
    memmove(m->given, m->given + first, (size_t)m->n_given * sizeof(given_t));
  }
  return 1;
}

static int get_value(machine_t *m, unsigned reference, double *value) {
  refresh(m);
  if (reference < INPUTS) *value = m->present.time;
  else if (reference < MEASURED) *value = m->u[reference - INPUTS];
  else if (reference < STATES) {
    const unsigned k = reference - MEASURED;
    double y[NY];
    model_y(IS_PRESSURE[k] && delay(m, PRESSURE_DELAYS) > 0.0 ? m->late.x : m->present.x, m->u, m->c, y);
    *value = y[k];
  } else if (reference < INNER) *value = m->present.x[reference - STATES];
  else if (reference < NUMBERS) {
    double inner[NA];
    model_inner(m->present.x, m->u, m->c, inner);
    *value = inner[reference - INNER];
  } else if (reference < START) *value = m->p[reference - NUMBERS];
  else if (reference < ALL) *value = m->start[reference - START];
  else {
    snprintf(m->message, sizeof m->message, "no variable has the value reference %u", reference);
    return 0;
  }
  return 1;
}

static int set_value(machine_t *m, unsigned reference, double value) {
  if (reference < INPUTS || (reference >= MEASURED && reference < NUMBERS) || reference >= ALL) {
    snprintf(m->message, sizeof m->message, "value reference %u is neither an input nor a parameter", reference);
    return 0;
  }
  if (reference < MEASURED) {
    const unsigned k = reference - INPUTS;
    if (!(value >= U_MINIMUM[k] && value <= U_MAXIMUM[k])) {
      snprintf(m->message, sizeof m->message, "%s: %g is outside %g .. %g %s", U_NAMES[k], value, U_MINIMUM[k], U_MAXIMUM[k],
               U_UNITS[k]);
      return 0;
    }
    m->u[k] = value;
    return 1;
  }
  const unsigned k = reference - NUMBERS;
  if (!(value >= N_MINIMUM[k] && value <= N_MAXIMUM[k])) {
    snprintf(m->message, sizeof m->message, "%s: %g is outside %g .. %g %s", N_NAMES[k], value, N_MINIMUM[k], N_MAXIMUM[k],
             N_UNITS[k]);
    return 0;
  }
  if (m->stage > INITIALISING && N_FIXED[k]) {
    snprintf(m->message, sizeof m->message, "%s is fixed: it can be set before the end of the initialisation", N_NAMES[k]);
    return 0;
  }
  if (reference < START) m->p[k] = value;
  else m->start[reference - START] = value;
  m->stale = 1;
  return 1;
}

static void begin_at(machine_t *m, double begin, int defined, double tolerance) {
  m->begin = begin;
  if (defined && tolerance > 0.0) m->tolerance = fmin(fmax(tolerance, FINEST), COARSEST);
  m->stale = 1;
}
