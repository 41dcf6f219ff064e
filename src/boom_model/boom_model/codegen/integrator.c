/* Adaptive Rosenbrock integration of x' = f(x, u, p) with piecewise constant inputs. The generated model precedes this text.

   Form without matrix-vector products (Hairer, Wanner, Solving ODEs II, ch. IV.7): with (I/(gamma h) - J) K_i =
   f(x + sum a_ij K_j) + sum (c_ij / h) K_j, the step is x + sum m_i K_i and the error estimate sum e_i K_i.
   RODAS3: Sandu et al. 1997 (order 3, 4 stages). RODAS: Hairer, Wanner 1996 (order 4, 6 stages).
   An input step starts a new interval: one-step methods lose nothing there, which is why they win (docs/performance.md). */

typedef struct {
  int stages, order;
  double gamma;
  double a[6][6], c[6][6], m[6], e[6];
  int fresh[6]; /* whether the stage evaluates f anew */
} method_t;

static const method_t RODAS3 = {
  4, 3, 0.5,
  {{0}, {0}, {2, 0}, {2, 0, 1}},
  {{0}, {4}, {1, -1}, {1, -1, -8.0 / 3.0}},
  {2, 0, 1, 1}, {0, 0, 0, 1}, {1, 0, 1, 1}};

static const method_t RODAS4 = {
  6, 4, 0.25,
  {{0},
   {1.544},
   {0.9466785280815826, 0.2557011698983284},
   {3.314825187068521, 2.896124015972201, 0.9986419139977817},
   {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
   {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1}},
  {{0},
   {-5.6688},
   {-2.430093356833875, -0.2063599157091915},
   {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
   {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
   {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}},
  {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1, 1},
  {0, 0, 0, 0, 0, 1}, {1, 1, 1, 1, 1, 1}};

enum { OK = 0, STEP_VANISHED = 1, LEFT_RANGE = 2, INTERRUPTED = 3 };

typedef struct {
  const double *scale, *minimum, *maximum;
  double tolerance;
  volatile const int *stop; /* set to non-zero from another thread to end the run */
  long steps, rejected, evaluations;
  double time;     /* of the failure */
  int state;       /* that left its range */
  double first;    /* step size that suits the beginning of the last interval */
  int hold;        /* a state that would leave its range is held at its limit instead */
  long most;       /* steps for one interval at most, 0: any number */
  struct sensitivity *sense; /* 0: none; see sensitivity.c */
} run_t;

#if LANES == 1
/* Cubic Hermite interpolation inside a step of length h from (x0, f0) to (x1, f1), theta in 0..1. */
static void interpolate(double theta, double h, const double *x0, const double *f0, const double *x1, const double *f1,
                        double *x) {
  const double t = theta, s = 1 - t;
  const double b0 = s * s * (1 + 2 * t), b1 = t * t * (3 - 2 * t), g0 = t * s * s * h, g1 = -t * t * s * h;
  for (int i = 0; i < NX; i++) x[i] = b0 * x0[i] + b1 * x1[i] + g0 * f0[i] + g1 * f1[i];
}
#endif

/* Integrates x over [t0, t1] with the input u held. Outputs at times out_t[*next] <= t1 are written.
   h: step size, kept from interval to interval. Inlined once for each method, so that its table is unrolled into the code. */
static inline __attribute__((always_inline)) int
interval_with(const method_t *m, run_t *r, real *x, const real *u, const real *c, double t0, double t1, double *h,
                    const double *out_t, long n_out, long *next, double *out_x, double *out_y) {
  real f0[NX], J[NX * NX], W[NW], K[6][NX], y[NX], fv[NX];
  const double length = t1 - t0;
  double t = 0.0;
  const long begun = r->steps;
  int have = 0, rejected = 0;
  for (int i = 0; i < NX * NX; i++) J[i] = R(0.0);
#if LANES == 1
  double x0[NX], f1[NX];
  while (*next < n_out && out_t[*next] <= t0) {
    for (int i = 0; i < NX; i++) out_x[*next * NX + i] = x[i];
    model_y(x, u, c, out_y + *next * NY);
    ++*next;
  }
#else
  (void)out_t, (void)n_out, (void)next, (void)out_x, (void)out_y;
#endif
  if (length <= 0) return OK;
  for (;;) {
    double step = *h;
    int last = 0;
    if (t + step * 1.0001 >= length) { step = length - t; last = 1; }
    else if (t + 2 * step > length) step = 0.5 * (length - t);
    if (!have) {
      model_fj(x, u, c, f0, J);
      have = 1;
      r->evaluations++;
#ifdef SENSITIVE
      if (r->sense) driven(r->sense, x, u, c);
#endif
    }
    model_factor(J, 1.0 / (m->gamma * step), W);
    const double inverse = 1.0 / step;
    for (int s = 0; s < m->stages; s++) {
      const real *f = f0;
      if (s > 0 && m->fresh[s]) {
        for (int i = 0; i < NX; i++) {
          real sum = x[i];
          for (int j = 0; j < s; j++) sum += m->a[s][j] * K[j][i];
          y[i] = sum;
        }
        model_f(y, u, c, fv);
        r->evaluations++;
        f = fv;
      }
      for (int i = 0; i < NX; i++) {
        real sum = R(0.0);
        for (int j = 0; j < s; j++) sum += m->c[s][j] * K[j][i];
        K[s][i] = f[i] + sum * inverse;
      }
      model_solve(W, K[s]);
    }
    real square = R(0.0);
    for (int i = 0; i < NX; i++) {
      real sum = x[i], e = R(0.0);
      for (int j = 0; j < m->stages; j++) { sum += m->m[j] * K[j][i]; e += m->e[j] * K[j][i]; }
      y[i] = sum;
      const real size = boom_max(boom_fabs(x[i]), boom_fabs(sum));
      e /= r->tolerance * boom_max(R(r->scale[i]), size);
      square += e * e;
    }
    double error = sqrt(boom_largest(square) / NX);
    if (!(error < 1e10)) error = 1e10; /* NaN and infinity too */
    double factor = 0.9 * pow(fmax(error, 1e-8), -1.0 / m->order);
    factor = fmin(5.0, fmax(0.15, factor));
    r->steps++;
    if (error > 1.0) {
      r->rejected++;
      rejected = 1;
      *h = step * factor;
      if (*h < 1e-12) { r->time = t0 + t; r->state = -1; return STEP_VANISHED; }
      continue;
    }
    if (r->most && r->steps - begun > r->most) { r->time = t0 + t; r->state = -1; return STEP_VANISHED; }
#if LANES == 1
    for (int i = 0; i < NX; i++) x0[i] = x[i];
#endif
    if (r->hold) {
      for (int i = 0; i < NX; i++) x[i] = boom_min(boom_max(y[i], R(r->minimum[i])), R(r->maximum[i]));
    } else for (int i = 0; i < NX; i++) {
      x[i] = y[i];
      const double beyond = boom_largest(boom_max(R(r->minimum[i]) - x[i], x[i] - R(r->maximum[i])));
      if (!(beyond <= 0.0)) { r->time = t0 + t + step; r->state = i; return LEFT_RANGE; }
    }
#if LANES == 1
    const double start = t;
#endif
    if (rejected && factor > 1.0) factor = 1.0;
    if (t == 0.0) r->first = step * factor;
    t = last ? length : t + step;
#if LANES == 1
    if (*next < n_out && out_t[*next] < t0 + t) {
      model_f(x, u, c, f1);
      r->evaluations++;
      while (*next < n_out && out_t[*next] < t0 + t) {
        double z[NX];
        interpolate((out_t[*next] - t0 - start) / step, step, x0, f0, x, f1, z);
        for (int i = 0; i < NX; i++) out_x[*next * NX + i] = z[i];
        model_y(z, u, c, out_y + *next * NY);
        ++*next;
      }
    }
#endif
    rejected = 0;
    have = 0;
#ifdef SENSITIVE
    if (r->sense) {
      sensed(r->sense, step, x, u, c, f0, J);
      for (int i = 0; i < NX; i++) if (x[i] != y[i]) held_still(r->sense, i);
      have = 1; /* f0 and J are those of the end of the step, where the next one begins */
      r->evaluations++;
    }
#endif
    if (!last || factor < 1.0) *h = step * factor;
    else if (step * factor > *h) *h = step * factor;
    if (last) return OK;
  }
}

static int interval(int order, run_t *r, real *x, const real *u, const real *c, double t0, double t1, double *h,
                    const double *out_t, long n_out, long *next, double *out_x, double *out_y) {
  return order == 3 ? interval_with(&RODAS3, r, x, u, c, t0, t1, h, out_t, n_out, next, out_x, out_y)
                    : interval_with(&RODAS4, r, x, u, c, t0, t1, h, out_t, n_out, next, out_x, out_y);
}
