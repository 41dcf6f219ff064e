/* Derivatives of a run with respect to directions: S = dx/dz with S' = J S + G, J = df/dx, G = df/dp dp/dz + df/du du/dz.

   From step to step of the integrator with the means of J and G at both ends, and exp by Pade's (1, 2), L-stable as the stiff
   pressures need (z = h J):  (1 - 2/3 z + z^2/6) S1 = S0 + h G + z (S0 / 3 - h G / 6).
   Where f has a kink the derivatives of one side count; f does not jump. Stands between the model and integrator.c. */

/* m directions. first[NP + 1], column, size: dp, row by row without zeros (number l has size[q] in direction column[q],
   first[l] <= q < first[l + 1]). Of the inputs in one direction, moved (-1: none): inputs[n_in][NU], input those that act now. Of the
   samples of a channel in one direction each, timed[NY] (-1: none): share, value [n][NY]. S[NX][m]: at the beginning in.
   D[n][NY][m]: of the innovations, out. The rest is for work. */
struct sensitivity {
  long m;
  const int *first, *column;
  const double *size;
  long moved;
  const double *inputs;
  const int *timed;
  const double *share, *value;
  double *S, *D;
  const double *input;
  double *G, *G1, *T, *B; /* [NX][m] */
  double *before, *after; /* [NY][m] */
};

static void drive(const struct sensitivity *s, const double *x, const double *u, const double *c, double *G) {
  double nz[NFP];
  model_fp(x, u, c, nz);
  memset(G, 0, NX * s->m * sizeof *G);
  for (int k = 0; k < NFP; k++)
    for (int q = s->first[FP_COLUMN[k]]; q < s->first[FP_COLUMN[k] + 1]; q++)
      G[FP_ROW[k] * s->m + s->column[q]] += nz[k] * s->size[q];
  if (s->moved < 0) return;
  double by_input[NFU > 0 ? NFU : 1];
  model_fu(x, u, c, by_input);
  for (int k = 0; k < NFU; k++) G[FU_ROW[k] * s->m + s->moved] += by_input[k] * s->input[FU_COLUMN[k]];
}

/* At the beginning of a step. */
static void driven(struct sensitivity *s, const double *x, const double *u, const double *c) { drive(s, x, u, c, s->G); }

/* From the beginning of a step to its end x: J that of the beginning in, of the end out, and f of the end. */
static void sensed(struct sensitivity *s, double h, const double *x, const double *u, const double *c, double *f, double *J) {
  const long m = s->m;
  double z[NX][NX], d[NX][NX], J1[NX * NX] = {0};
  model_fj(x, u, c, f, J1);
  drive(s, x, u, c, s->G1);
  for (int i = 0; i < NX * NX; i++) z[i / NX][i % NX] = 0.5 * h * (J[i] + J1[i]);
  memcpy(J, J1, sizeof J1);
  for (int i = 0; i < NX; i++) {
    for (int j = 0; j < NX; j++) d[i][j] = (i == j) - 2.0 / 3.0 * z[i][j];
    for (int k = 0; k < NX; k++) {
      if (z[i][k] == 0.0) continue;
      for (int j = 0; j < NX; j++) d[i][j] += z[i][k] * z[k][j] / 6.0;
    }
  }
  for (long q = 0; q < NX * m; q++) {
    const double g = 0.5 * h * (s->G[q] + s->G1[q]);
    s->T[q] = s->S[q] / 3.0 - g / 6.0;
    s->B[q] = s->S[q] + g;
  }
  double *G = s->G;
  s->G = s->G1, s->G1 = G;
  for (int i = 0; i < NX; i++)
    for (int k = 0; k < NX; k++) {
      if (z[i][k] == 0.0) continue;
      double *to = s->B + i * m;
      const double *from = s->T + k * m, factor = z[i][k];
      for (long q = 0; q < m; q++) to[q] += factor * from[q];
    }
  for (int k = 0; k < NX; k++) /* pivots on the diagonal, as in model_factor */
    for (int i = k + 1; i < NX; i++) {
      const double factor = d[i][k] / d[k][k];
      if (factor == 0.0) continue;
      for (int j = k + 1; j < NX; j++) d[i][j] -= factor * d[k][j];
      for (long q = 0; q < m; q++) s->B[i * m + q] -= factor * s->B[k * m + q];
    }
  for (int k = NX - 1; k >= 0; k--) {
    double *to = s->S + k * m;
    memcpy(to, s->B + k * m, m * sizeof *to);
    for (int j = k + 1; j < NX; j++) {
      if (d[k][j] == 0.0) continue;
      for (long q = 0; q < m; q++) to[q] -= d[k][j] * s->S[j * m + q];
    }
    for (long q = 0; q < m; q++) to[q] /= d[k][k];
  }
}

/* A state that is held at a limit. */
static void held_still(struct sensitivity *s, int i) { memset(s->S + i * s->m, 0, s->m * sizeof *s->S); }

/* Y[NY][m] of the outputs. */
static void shown(struct sensitivity *s, const double *x, const double *u, const double *c, double *Y) {
  double by_state[NYX > 0 ? NYX : 1], by_number[NYP > 0 ? NYP : 1];
  model_yx(x, u, c, by_state);
  model_yp(x, u, c, by_number);
  memset(Y, 0, NY * s->m * sizeof *Y);
  for (int k = 0; k < NYX; k++)
    for (long q = 0; q < s->m; q++) Y[YX_ROW[k] * s->m + q] += by_state[k] * s->S[YX_COLUMN[k] * s->m + q];
  for (int k = 0; k < NYP; k++)
    for (int q = s->first[YP_COLUMN[k]]; q < s->first[YP_COLUMN[k] + 1]; q++)
      Y[YP_ROW[k] * s->m + s->column[q]] += by_number[k] * s->size[q];
}

/* Of the innovations of interval k, and of the correction with gain[NX][NY]. */
static void corrected(struct sensitivity *s, long k, const double *theta, const double *measured, const double *gain,
                      const double *y_before, const double *y_after) {
  for (int j = 0; j < NY; j++) {
    double *d = s->D + (k * NY + j) * s->m;
    const double *before = s->before + j * s->m, *after = s->after + j * s->m;
    if (measured[j] != measured[j]) {
      memset(d, 0, s->m * sizeof *d);
      continue;
    }
    for (long q = 0; q < s->m; q++) d[q] = -(before[q] + theta[j] * (after[q] - before[q]));
    if (s->timed[j] >= 0) d[s->timed[j]] += s->value[k * NY + j] - s->share[k * NY + j] * (y_after[j] - y_before[j]);
    for (int i = 0; i < NX; i++) {
      const double factor = gain[i * NY + j];
      if (factor == 0.0) continue;
      for (long q = 0; q < s->m; q++) s->S[i * s->m + q] += factor * d[q];
    }
  }
}
