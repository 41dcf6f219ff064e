/* Prediction from sample to sample with correction by the measurement: an observer with given gains. Follows integrator.c. */

/* Between two samples. Five are usual, hundreds where a valve chatters; where a state is pushed against its limit by numbers that no
   machine has (a volume below zero), it would be millions. */
#define MOST_STEPS 5000

/* grid[n+1]: times between which the model predicts. theta, measured [n][NY]: in interval k channel j was sampled at
   grid[k] + theta (grid[k+1] - grid[k]); NaN: not. gain[n][NX][NY]. x: start in, end out.
   innovation[n][NY]: measured - predicted (NaN where nothing was), predicted linearly between both ends of the interval.
   states[n][NX]: corrected state at the beginning of each interval. What would leave a state's range, in the prediction or by the
   correction, is held at its limit: a model that lacks what moves the machine goes on, and is seen to be wrong.
   report as in boom_run; report[7]: intervals done.
   With lanes p, x, u, theta, measured, innovation and states have one more dimension of LANES numbers, the last; where one lane fails,
   all end. */
static int observe(const double *p, double *x, const double *grid, long n, const double *t_in, const double *u, long n_in,
                   const double *theta, const double *measured, const double *gain, double *innovation, double *states,
                   double tolerance, int order, const double *scale, const double *minimum, const double *maximum, double h,
                   double *report, struct sensitivity *sense) {
  real c[NC], before[NY], after[NY], number[NP], state[NX], held[NU];
  run_t r = {scale, minimum, maximum, tolerance, 0, 0, 0, 0, 0.0, -1, 0.0, 1, MOST_STEPS, sense};
  long k, next = 0, i_in = 0;
  int status = OK;
  for (int i = 0; i < NP; i++) number[i] = boom_load(p + i * LANES);
  for (int i = 0; i < NX; i++) state[i] = boom_load(x + i * LANES);
  model_prepare(number, c);
  while (i_in + 1 < n_in && t_in[i_in + 1] <= grid[0]) i_in++;
  for (k = 0; k < n; k++) {
    double t = grid[k];
    for (int i = 0; i < NX; i++) boom_store(states + (k * NX + i) * LANES, state[i]);
    for (int i = 0; i < NU; i++) held[i] = boom_load(u + (i_in * NU + i) * LANES);
    if (r.first > 0.0) h = r.first; /* a correction and a step of the input are like those before, not like the end of an interval */
    model_y(state, held, c, before);
#ifdef SENSITIVE
    if (sense) {
      sense->input = sense->inputs + i_in * NU;
      shown(sense, state, held, c, sense->before);
    }
#endif
    for (;;) {
      const int steps_in = i_in + 1 < n_in && t_in[i_in + 1] < grid[k + 1];
      const double end = steps_in ? t_in[i_in + 1] : grid[k + 1];
      status = interval(order, &r, state, held, c, t, end, &h, 0, 0, &next, 0, 0);
      if (status != OK || !steps_in) break;
      t = end;
      i_in++;
      for (int i = 0; i < NU; i++) held[i] = boom_load(u + (i_in * NU + i) * LANES);
#ifdef SENSITIVE
      if (sense) sense->input = sense->inputs + i_in * NU;
#endif
    }
    if (status != OK) break;
    model_y(state, held, c, after);
    const double *g = gain + k * NX * NY;
#ifdef SENSITIVE
    if (sense) {
      shown(sense, state, held, c, sense->after);
      corrected(sense, k, theta + k * NY, measured + k * NY, g, before, after);
    }
#endif
    for (int j = 0; j < NY; j++) {
      const long at = (k * NY + j) * LANES;
      const real y = boom_load(measured + at);
      const real e = y - (before[j] + boom_load(theta + at) * (after[j] - before[j]));
      boom_store(innovation + at, e);
      const real known = boom_choose(y - y == R(0.0), e, R(0.0)); /* NaN: not measured */
      for (int i = 0; i < NX; i++) state[i] += R(g[i * NY + j]) * known;
    }
#ifdef SENSITIVE
    if (sense) for (int i = 0; i < NX; i++) if (state[i] < minimum[i] || state[i] > maximum[i]) held_still(sense, i);
#endif
    for (int i = 0; i < NX; i++) state[i] = boom_min(boom_max(state[i], R(minimum[i])), R(maximum[i]));
  }
  for (int i = 0; i < NX; i++) boom_store(x + i * LANES, state[i]);
  report[0] = status; report[1] = r.time; report[2] = r.state; report[3] = (double)r.steps;
  report[4] = (double)r.rejected; report[5] = (double)r.evaluations; report[6] = h; report[7] = (double)k;
  return status;
}

int boom_observe(const double *p, double *x, const double *grid, long n, const double *t_in, const double *u, long n_in,
                 const double *theta, const double *measured, const double *gain, double *innovation, double *states,
                 double tolerance, int order, const double *scale, const double *minimum, const double *maximum, double h,
                 double *report) {
  return observe(p, x, grid, n, t_in, u, n_in, theta, measured, gain, innovation, states, tolerance, order, scale, minimum,
                 maximum, h, report, 0);
}

#ifdef SENSITIVE
/* The same with derivatives in the directions of struct sensitivity, whose work is (4 NX + 2 NY) m doubles. */
int boom_sensitivity(const double *p, double *x, const double *grid, long n, const double *t_in, const double *u, long n_in,
                     const double *theta, const double *measured, const double *gain, double *innovation, double *states,
                     double tolerance, int order, const double *scale, const double *minimum, const double *maximum, double h,
                     double *report, long m, const int *first, const int *column, const double *size, long moved,
                     const double *inputs, const int *timed, const double *share, const double *value, double *s, double *d,
                     double *work) {
  double *const w = work;
  struct sensitivity sense = {m, first, column, size, moved, inputs, timed, share, value, s, d, inputs, w, w + NX * m,
                              w + 2 * NX * m, w + 3 * NX * m, w + 4 * NX * m, w + (4 * NX + NY) * m};
  return observe(p, x, grid, n, t_in, u, n_in, theta, measured, gain, innovation, states, tolerance, order, scale, minimum,
                 maximum, h, report, &sense);
}
#endif

/* From x[n][NX] at the beginning of each interval to its end, each interval for itself, with inputs as in boom_observe:
   end[n][NX], before[n][NY] and after[n][NY]. Of lanes each has its own numbers and its own move[NX] of the beginning, and all share
   the steps, so that differences between them are good derivatives. Returns 0, or 1 + the interval that failed. */
long boom_intervals(const double *p, const double *x, const double *move, const double *grid, long n, const double *t_in,
                    const double *u, long n_in, double tolerance, int order, const double *scale, const double *minimum,
                    const double *maximum, double h, double *end, double *before, double *after) {
  real c[NC], seen[NY], number[NP], state[NX], held[NU], off[NX];
  run_t r = {scale, minimum, maximum, tolerance, 0, 0, 0, 0, 0.0, -1, 0.0, 1, MOST_STEPS, 0};
  long next = 0, i_in = 0;
  for (int i = 0; i < NP; i++) number[i] = boom_load(p + i * LANES);
  for (int i = 0; i < NX; i++) off[i] = boom_load(move + i * LANES);
  model_prepare(number, c);
  while (i_in + 1 < n_in && t_in[i_in + 1] <= grid[0]) i_in++;
  for (long k = 0; k < n; k++) {
    double t = grid[k];
    for (int i = 0; i < NX; i++) state[i] = R(x[k * NX + i]) + off[i];
    for (int i = 0; i < NU; i++) held[i] = boom_load(u + (i_in * NU + i) * LANES);
    if (r.first > 0.0) h = r.first;
    model_y(state, held, c, seen);
    for (int i = 0; i < NY; i++) boom_store(before + (k * NY + i) * LANES, seen[i]);
    for (;;) {
      const int steps_in = i_in + 1 < n_in && t_in[i_in + 1] < grid[k + 1];
      const double until = steps_in ? t_in[i_in + 1] : grid[k + 1];
      if (interval(order, &r, state, held, c, t, until, &h, 0, 0, &next, 0, 0) != OK) return 1 + k;
      if (!steps_in) break;
      t = until;
      i_in++;
      for (int i = 0; i < NU; i++) held[i] = boom_load(u + (i_in * NU + i) * LANES);
    }
    model_y(state, held, c, seen);
    for (int i = 0; i < NX; i++) boom_store(end + (k * NX + i) * LANES, state[i]);
    for (int i = 0; i < NY; i++) boom_store(after + (k * NY + i) * LANES, seen[i]);
  }
  return 0;
}

#if LANES == 1
/* f[n][NX] and J[n][NX][NX] along a trajectory. */
void boom_derivatives(const double *p, const double *x, const double *u, long n, double *f, double *J) {
  double c[NC];
  model_prepare(p, c);
  for (long k = 0; k < n * NX * NX; k++) J[k] = 0.0;
  for (long k = 0; k < n; k++) model_fj(x + k * NX, u + k * NU, c, f + k * NX, J + k * NX * NX);
}

/* Riccati recursion of the Kalman filter. transition, process [n][NX][NX] of each interval; output [NY][NX];
   valid, variance [n][NY]: 1 where measured, of its noise; covariance [NX][NX]: start in, end out.
   gain [n][NX][NY] and innovation [n][NY][NY], the covariance of the innovations. Channels that were not measured get no gain. */
void boom_riccati(long n, const double *transition, const double *process, const double *output, const unsigned char *valid,
                  const double *variance, double *covariance, double *gain, double *innovation) {
  double M[NX * NX], H[NY][NX], PH[NX][NY], MH[NX][NY], S[NY][NY], V[NY][NY];
  double *P = covariance;
  for (long k = 0; k < n; k++) {
    const double *A = transition + k * NX * NX, *Q = process + k * NX * NX;
    for (int i = 0; i < NX; i++)
      for (int j = 0; j < NX; j++) {
        double sum = 0.0;
        for (int l = 0; l < NX; l++) sum += A[i * NX + l] * P[l * NX + j];
        M[i * NX + j] = sum;
      }
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        double sum = 0.5 * (Q[i * NX + j] + Q[j * NX + i]);
        for (int l = 0; l < NX; l++) sum += M[i * NX + l] * A[j * NX + l];
        P[i * NX + j] = P[j * NX + i] = sum;
      }
    for (int a = 0; a < NY; a++)
      for (int i = 0; i < NX; i++) H[a][i] = valid[k * NY + a] ? output[a * NX + i] : 0.0;
    /* Where what grows by orders in a void has cost the covariance its positivity, the variances alone are kept: already
       where rounding decides, or a Cholesky decomposition may judge otherwise than the pivots here. */
    for (int positive = 0, again = 0; !positive && again < 2; again++) {
      if (again) for (int i = 0; i < NX * NX; i++) P[i] = i % (NX + 1) ? 0.0 : fabs(P[i]);
      for (int i = 0; i < NX; i++)
        for (int a = 0; a < NY; a++) {
          double sum = 0.0;
          for (int l = 0; l < NX; l++) sum += P[i * NX + l] * H[a][l];
          PH[i][a] = sum;
        }
      for (int a = 0; a < NY; a++)
        for (int b = 0; b < NY; b++) {
          double sum = a == b ? variance[k * NY + a] : 0.0;
          for (int l = 0; l < NX; l++) sum += H[a][l] * PH[l][b];
          S[a][b] = innovation[(k * NY + a) * NY + b] = sum;
          V[a][b] = a == b;
        }
      positive = 1;
      for (int a = 0; a < NY; a++) { /* Gauss-Jordan */
        positive &= S[a][a] > 1e-12 * innovation[(k * NY + a) * NY + a];
        const double pivot = 1.0 / S[a][a];
        for (int b = 0; b < NY; b++) { S[a][b] *= pivot; V[a][b] *= pivot; }
        for (int r = 0; r < NY; r++) {
          if (r == a) continue;
          const double factor = S[r][a];
          for (int b = 0; b < NY; b++) { S[r][b] -= factor * S[a][b]; V[r][b] -= factor * V[a][b]; }
        }
      }
    }
    double *g = gain + k * NX * NY;
    for (int i = 0; i < NX; i++)
      for (int a = 0; a < NY; a++) {
        double sum = 0.0;
        for (int b = 0; b < NY; b++) sum += PH[i][b] * V[b][a];
        g[i * NY + a] = sum;
      }
    /* Joseph's form, (I - K H) P (I - K H)' + K R K': what grows by orders in a void keeps the covariance positive */
    for (int i = 0; i < NX; i++)
      for (int j = 0; j < NX; j++) {
        double sum = P[i * NX + j];
        for (int a = 0; a < NY; a++) sum -= g[i * NY + a] * PH[j][a];
        M[i * NX + j] = sum;
      }
    for (int i = 0; i < NX; i++)
      for (int a = 0; a < NY; a++) {
        double sum = 0.0;
        for (int l = 0; l < NX; l++) sum += M[i * NX + l] * H[a][l];
        MH[i][a] = sum - g[i * NY + a] * variance[k * NY + a];
      }
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        double sum = 0.5 * (M[i * NX + j] + M[j * NX + i]);
        for (int a = 0; a < NY; a++) sum -= 0.5 * (MH[i][a] * g[j * NY + a] + MH[j][a] * g[i * NY + a]);
        P[i * NX + j] = P[j * NX + i] = sum;
      }
  }
}
#endif
