/* Runs, single steps and derivatives, as Python calls them. Follows integrator.c. */

#if LANES == 1
/* One run. t_in[n_in], u[n_in][NU]: the input u[k] holds from t_in[k] to t_in[k+1]; before t_in[0] it is u[0]. From t_begin to
   t_end. out_t ascending. x: start in, end out. report: status, failing time, failing state, steps, rejected, evaluations. */
int boom_run(const double *p, double *x, double t_begin, double t_end, const double *t_in, const double *u, long n_in,
             const double *out_t, long n_out, double *out_x, double *out_y, double tolerance, int order,
             const double *scale, const double *minimum, const double *maximum, double h, volatile const int *stop,
             double *report) {
  double c[NC];
  run_t r = {scale, minimum, maximum, tolerance, stop, 0, 0, 0, 0.0, -1, 0.0, 0, 0, 0};
  long next = 0, k = 0;
  int status = OK;
  model_prepare(p, c);
  double t = t_begin;
  while (k + 1 < n_in && t_in[k + 1] <= t) k++;
  while (status == OK) {
    const double end = (k + 1 < n_in && t_in[k + 1] < t_end) ? t_in[k + 1] : t_end;
    status = interval(order, &r, x, u + k * NU, c, t, end, &h, out_t, n_out, &next, out_x, out_y);
    if (status != OK || end >= t_end) break;
    if (stop && *stop) { status = INTERRUPTED; r.time = end; break; }
    t = end;
    k++;
  }
  if (status == OK)
    while (next < n_out && out_t[next] <= t_end + 1e-12) {
      for (int i = 0; i < NX; i++) out_x[next * NX + i] = x[i];
      model_y(x, u + k * NU, c, out_y + next * NY);
      next++;
    }
  report[0] = status; report[1] = r.time; report[2] = r.state; report[3] = (double)r.steps;
  report[4] = (double)r.rejected; report[5] = (double)r.evaluations; report[6] = h; report[7] = (double)next;
  return status;
}

/* One step of length dt with u held: x in place, y the outputs at its end, h the step size to begin with, updated. */
int boom_step(const double *c, double *x, const double *u, double dt, double *y, double tolerance, int order,
              const double *scale, const double *minimum, const double *maximum, double *h, double *report) {
  run_t r = {scale, minimum, maximum, tolerance, 0, 0, 0, 0, 0.0, -1, 0.0, 0, 0, 0};
  long next = 0;
  const int status = interval(order, &r, x, u, c, 0.0, dt, h, 0, 0, &next, 0, 0);
  model_y(x, u, c, y);
  report[0] = status; report[1] = r.time; report[2] = r.state;
  return status;
}

void boom_prepare(const double *p, double *c) { model_prepare(p, c); }

void boom_derivative(const double *p, const double *x, const double *u, double *f, double *J) {
  double c[NC];
  model_prepare(p, c);
  for (int i = 0; i < NX * NX; i++) J[i] = 0.0;
  model_fj(x, u, c, f, J);
}

/* df/dx (n, NX, NX) and df/du (n, NX, NU) at n points; df/du by central differences of 10 uA. */
void boom_linearise(const double *p, const double *x, const double *u, long n, double *by_state, double *by_input) {
  double c[NC], f[NX], g[NX], v[NU];
  const double d = 1e-5;
  model_prepare(p, c);
  for (long k = 0; k < n; k++) {
    double *J = by_state + k * NX * NX, *B = by_input + k * NX * NU;
    for (int i = 0; i < NX * NX; i++) J[i] = 0.0;
    model_fj(x + k * NX, u + k * NU, c, f, J);
    for (int j = 0; j < NU; j++) {
      for (int i = 0; i < NU; i++) v[i] = u[k * NU + i];
      v[j] = u[k * NU + j] + d;
      model_f(x + k * NX, v, c, f);
      v[j] = u[k * NU + j] - d;
      model_f(x + k * NX, v, c, g);
      for (int i = 0; i < NX; i++) B[i * NU + j] = (f[i] - g[i]) / (2 * d);
    }
  }
}

void boom_outputs(const double *p, const double *x, const double *u, double *y) {
  double c[NC];
  model_prepare(p, c);
  model_y(x, u, c, y);
}

int boom_sizes(int which) { return which == 0 ? NX : which == 1 ? NU : which == 2 ? NP : which == 3 ? NY : NC; }
#endif
