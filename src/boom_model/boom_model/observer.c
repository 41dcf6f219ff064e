/* Prediction from sample to sample with correction by the measurement: an observer with given gains. Follows integrator.c. */

/* grid[n+1]: times between which the model predicts. theta, measured [n][NY]: in interval k channel j was sampled at
   grid[k] + theta (grid[k+1] - grid[k]); NaN: not. gain[n][NX][NY]. x: start in, end out.
   innovation[n][NY]: measured - predicted (NaN where nothing was), predicted linearly between both ends of the interval.
   states[n][NX]: corrected state at the beginning of each interval. A correction that leaves a state's range ends at its limit.
   report as in boom_run; report[7]: intervals done. */
int boom_observe(const double *p, double *x, const double *grid, long n, const double *t_in, const double *u, long n_in,
                 const double *theta, const double *measured, const double *gain, double *innovation, double *states,
                 double tolerance, int order, const double *scale, const double *minimum, const double *maximum, double h,
                 double *report) {
  double c[NC > 0 ? NC : 1], before[NY], after[NY];
  run_t r = {scale, minimum, maximum, tolerance, 0, 0, 0, 0, 0.0, -1};
  long k, next = 0, i_in = 0;
  int status = OK;
  model_prepare(p, c);
  while (i_in + 1 < n_in && t_in[i_in + 1] <= grid[0]) i_in++;
  for (k = 0; k < n; k++) {
    double t = grid[k];
    for (int i = 0; i < NX; i++) states[k * NX + i] = x[i];
    model_y(x, u + i_in * NU, c, before);
    for (;;) {
      const int steps_in = i_in + 1 < n_in && t_in[i_in + 1] < grid[k + 1];
      const double end = steps_in ? t_in[i_in + 1] : grid[k + 1];
      status = interval(order, &r, x, u + i_in * NU, c, t, end, &h, 0, 0, &next, 0, 0);
      if (status != OK || !steps_in) break;
      t = end;
      i_in++;
    }
    if (status != OK) break;
    model_y(x, u + i_in * NU, c, after);
    const double *th = theta + k * NY, *y = measured + k * NY, *g = gain + k * NX * NY;
    double *e = innovation + k * NY;
    for (int j = 0; j < NY; j++) {
      e[j] = y[j] - (before[j] + th[j] * (after[j] - before[j]));
      if (!isfinite(e[j])) continue;
      for (int i = 0; i < NX; i++) x[i] += g[i * NY + j] * e[j];
    }
    for (int i = 0; i < NX; i++) x[i] = fmin(fmax(x[i], minimum[i]), maximum[i]);
  }
  report[0] = status; report[1] = r.time; report[2] = r.state; report[3] = (double)r.steps;
  report[4] = (double)r.rejected; report[5] = (double)r.evaluations; report[6] = h; report[7] = (double)k;
  return status;
}

/* f[n][NX] and J[n][NX][NX] along a trajectory. */
void boom_derivatives(const double *p, const double *x, const double *u, long n, double *f, double *J) {
  double c[NC > 0 ? NC : 1];
  model_prepare(p, c);
  for (long k = 0; k < n * NX * NX; k++) J[k] = 0.0;
  for (long k = 0; k < n; k++) model_fj(x + k * NX, u + k * NU, c, f + k * NX, J + k * NX * NX);
}
