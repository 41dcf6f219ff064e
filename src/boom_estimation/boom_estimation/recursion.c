/* Kalman filter of a model linearised along an observer's trajectory. NX states, NY outputs, NQ discrepancies are defined before.

   Everything is a deviation from that observer, which had gains given[n][NX][NY] and innovations seen[n][NY]: so innovations,
   gains and derivatives for any size of the discrepancies are a linear recursion, without integration.

   transition[n][NX][NX], process[n][NX][NX]: of each interval; entry[n][NX][NQ], size[NQ]: how discrepancies enter and the variance
   that each brings in an interval; output[NY][NX], share[n][NY]: when in its interval a channel was sampled; valid[n][NY]: whether.
   variance[NY]: of the sensors' noise. start[NX][NX]: covariance of the initial state.
   count columns, derivatives by numbers: forced[n][NX][count] in the states, shown[n][NY][count] in the outputs,
   begin[NX][count] in the initial state; moved[count]: how far the numbers are from those of the observer.
   Out: innovation[n][NY], factor[n][NY][NY] (Cholesky, lower, of its covariance), white[n][NY], by[n][NY][count] whitened
   derivatives (not if 0), gain[n][NX][NY]; filtered[n+1][NX][NX], predicted[n][NX][NX] covariances (not if 0).
   Returns 0, or 1 + the interval whose covariance was not positive. */
#include <math.h>
#include <string.h>

long kalman_recursion(long n, long count, const double *transition, const double *process, const double *entry, const double *size,
                      const double *output, const double *share, const unsigned char *valid, const double *variance,
                      const double *start, const double *seen, const double *given, const double *forced, const double *shown,
                      const double *begin, const double *moved, double *innovation, double *factor, double *white, double *by,
                      double *gain, double *filtered, double *predicted, double *work) {
  double P[NX][NX], T[NX][NX], PH[NX][NY], H[NY][NX], L[NY][NY], I[NY][NY], K[NX][NY], x[NX], next[NX], e[NY];
  double *S = work, *N = work + NX * count, *E = work + 2 * NX * count; /* [NX][count], [NX][count], [NY][count] */
  memcpy(P, start, sizeof P);
  for (int i = 0; i < NX; i++) {
    x[i] = 0.0;
    for (long j = 0; j < count; j++) x[i] += begin[i * count + j] * moved[j];
  }
  if (by) memcpy(S, begin, sizeof(double) * NX * count);
  if (filtered) memcpy(filtered, P, sizeof P);
  for (long k = 0; k < n; k++) {
    const double *A = transition + k * NX * NX, *Q = process + k * NX * NX, *G = entry + k * NX * NQ;
    const double *th = share + k * NY, *f = forced + k * NX * count, *s = shown + k * NY * count;
    const unsigned char *there = valid + k * NY;
    memset(T, 0, sizeof T);
    for (int i = 0; i < NX; i++)
      for (int l = 0; l < NX; l++) {
        const double a = A[i * NX + l];
        if (a != 0.0)
          for (int j = 0; j < NX; j++) T[i][j] += a * P[l][j];
      }
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        double sum = 0.5 * (Q[i * NX + j] + Q[j * NX + i]);
        for (int l = 0; l < NX; l++) sum += T[i][l] * A[j * NX + l];
        for (int l = 0; l < NQ; l++) sum += G[i * NQ + l] * size[l] * G[j * NQ + l];
        P[i][j] = P[j][i] = sum;
      }
    if (predicted) memcpy(predicted + k * NX * NX, P, sizeof P);
    for (int a = 0; a < NY; a++)
      for (int i = 0; i < NX; i++) H[a][i] = there[a] ? output[a * NX + i] : 0.0;
    for (int i = 0; i < NX; i++)
      for (int a = 0; a < NY; a++) {
        double sum = 0.0;
        for (int l = 0; l < NX; l++) sum += P[i][l] * H[a][l];
        PH[i][a] = sum;
      }
    for (int a = 0; a < NY; a++)
      for (int b = 0; b <= a; b++) { /* Cholesky of S = H P H' + R */
        double sum = a == b ? variance[a] : 0.0;
        for (int l = 0; l < NX; l++) sum += H[a][l] * PH[l][b];
        for (int l = 0; l < b; l++) sum -= L[a][l] * L[b][l];
        if (a == b) {
          if (!(sum > 0.0)) return 1 + k;
          L[a][a] = sqrt(sum);
        } else {
          L[a][b] = sum / L[b][b];
          L[b][a] = 0.0;
        }
      }
    for (int b = 0; b < NY; b++) /* I = L^-1 */
      for (int a = 0; a < NY; a++) {
        double sum = a == b;
        for (int l = b; l < a; l++) sum -= L[a][l] * I[l][b];
        I[a][b] = a < b ? 0.0 : sum / L[a][a];
      }
    for (int i = 0; i < NX; i++) {
      double v[NY];
      for (int a = 0; a < NY; a++) {
        v[a] = 0.0;
        for (int b = 0; b <= a; b++) v[a] += I[a][b] * PH[i][b];
      }
      for (int a = 0; a < NY; a++) {
        K[i][a] = 0.0;
        for (int b = a; b < NY; b++) K[i][a] += v[b] * I[b][a];
      }
    }
    for (int i = 0; i < NX; i++) {
      double sum = 0.0;
      for (int l = 0; l < NX; l++) sum += A[i * NX + l] * x[l];
      for (long j = 0; j < count; j++) sum += f[i * count + j] * moved[j];
      next[i] = sum;
    }
    for (int a = 0; a < NY; a++) {
      e[a] = 0.0;
      if (!there[a]) continue;
      double sum = 0.0;
      for (int i = 0; i < NX; i++) sum += output[a * NX + i] * (x[i] + th[a] * (next[i] - x[i]));
      for (long j = 0; j < count; j++) sum += s[a * count + j] * moved[j];
      e[a] = seen[k * NY + a] - sum;
    }
    for (int i = 0; i < NX; i++) {
      double sum = next[i];
      for (int a = 0; a < NY; a++)
        if (there[a]) sum += K[i][a] * e[a] - given[(k * NX + i) * NY + a] * seen[k * NY + a];
      x[i] = sum;
    }
    if (by) {
      memcpy(N, f, sizeof(double) * NX * count);
      for (int i = 0; i < NX; i++)
        for (int l = 0; l < NX; l++) {
          const double a = A[i * NX + l];
          if (a != 0.0)
            for (long j = 0; j < count; j++) N[i * count + j] += a * S[l * count + j];
        }
      for (int a = 0; a < NY; a++) {
        for (long j = 0; j < count; j++) E[a * count + j] = there[a] ? -s[a * count + j] : 0.0;
        if (!there[a]) continue;
        for (int i = 0; i < NX; i++) {
          const double c = output[a * NX + i];
          if (c != 0.0)
            for (long j = 0; j < count; j++)
              E[a * count + j] -= c * (S[i * count + j] + th[a] * (N[i * count + j] - S[i * count + j]));
        }
      }
      for (int i = 0; i < NX; i++)
        for (int a = 0; a < NY; a++) {
          const double c = there[a] ? K[i][a] : 0.0;
          if (c != 0.0)
            for (long j = 0; j < count; j++) N[i * count + j] += c * E[a * count + j];
        }
      memcpy(S, N, sizeof(double) * NX * count);
      double *J = by + k * NY * count;
      for (int a = 0; a < NY; a++)
        for (int b = 0; b <= a; b++)
          for (long j = 0; j < count; j++) {
            if (b == 0) J[a * count + j] = 0.0;
            J[a * count + j] += I[a][b] * E[b * count + j];
          }
    }
    for (int a = 0; a < NY; a++) {
      double sum = 0.0;
      for (int b = 0; b <= a; b++) sum += I[a][b] * e[b];
      white[k * NY + a] = sum;
      innovation[k * NY + a] = e[a];
    }
    memcpy(factor + k * NY * NY, L, sizeof L);
    if (gain) memcpy(gain + k * NX * NY, K, sizeof K);
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        double sum = 0.0;
        for (int a = 0; a < NY; a++) sum += 0.5 * (K[i][a] * PH[j][a] + K[j][a] * PH[i][a]);
        P[i][j] = P[j][i] = P[i][j] - sum;
      }
    if (filtered) memcpy(filtered + (k + 1) * NX * NX, P, sizeof P);
  }
  return 0;
}

/* exp(J h) of each interval, by Pade (1, 2) of half of it, L-stable, squared; and what noise brings. jacobian[n][NX][NX]; held[n][NX][r]: noise that is constant in an interval; density[n][NX]: of white noise; index[NQ]: the
   states that are discrepancies. Out: transition, process [n][NX][NX], entry[n][NX][NQ]. Returns 0, or 1 + a singular interval. */
long discretise(long n, long r, double h, const double *jacobian, const double *held, const double *density, const long long *index,
                double *transition, double *process, double *entry) {
  double D[NX][2 * NX], Z[NX][NX];
  for (long k = 0; k < n; k++) {
    const double *J = jacobian + k * NX * NX;
    for (int i = 0; i < NX; i++)
      for (int j = 0; j < NX; j++) Z[i][j] = J[i * NX + j] * 0.5 * h;
    for (int i = 0; i < NX; i++) {
      double row[NX];
      memset(row, 0, sizeof row);
      for (int l = 0; l < NX; l++)
        if (Z[i][l] != 0.0)
          for (int j = 0; j < NX; j++) row[j] += Z[i][l] * Z[l][j];
      for (int j = 0; j < NX; j++) {
        const double one = i == j;
        D[i][j] = one - Z[i][j] * (2.0 / 3.0) + row[j] / 6.0;
        D[i][NX + j] = one + Z[i][j] / 3.0;
      }
    }
    for (int a = 0; a < NX; a++) {
      int best = a;
      for (int i = a + 1; i < NX; i++)
        if (fabs(D[i][a]) > fabs(D[best][a])) best = i;
      if (!(fabs(D[best][a]) > 0.0)) return 1 + k;
      if (best != a)
        for (int j = 0; j < 2 * NX; j++) {
          const double swap = D[a][j];
          D[a][j] = D[best][j];
          D[best][j] = swap;
        }
      const double pivot = 1.0 / D[a][a];
      for (int j = a; j < 2 * NX; j++) D[a][j] *= pivot;
      for (int i = 0; i < NX; i++) {
        const double factor = D[i][a];
        if (i == a || factor == 0.0) continue;
        for (int j = a; j < 2 * NX; j++) D[i][j] -= factor * D[a][j];
      }
    }
    double *T = transition + k * NX * NX, *Q = process + k * NX * NX;
    for (int i = 0; i < NX; i++) {
      for (int j = 0; j < NX; j++) T[i * NX + j] = 0.0;
      for (int l = 0; l < NX; l++)
        if (D[i][NX + l] != 0.0)
          for (int j = 0; j < NX; j++) T[i * NX + j] += D[i][NX + l] * D[l][NX + j];
      for (int q = 0; q < NQ; q++) entry[(k * NX + i) * NQ + q] = D[i][NX + index[q]];
    }
    double in[NX][NX + 8];
    for (int i = 0; i < NX; i++) {
      for (int j = 0; j < NX; j++) in[i][j] = D[i][NX + j] * sqrt(density[k * NX + j] * h);
      for (long j = 0; j < r; j++) {
        in[i][NX + j] = 0.0;
        for (int l = 0; l < NX; l++) in[i][NX + j] += D[i][NX + l] * held[(k * NX + l) * r + j] * h;
      }
    }
    for (int i = 0; i < NX; i++)
      for (int j = 0; j <= i; j++) {
        double sum = 0.0;
        for (int l = 0; l < NX + r; l++) sum += in[i][l] * in[j][l];
        Q[i * NX + j] = Q[j * NX + i] = sum;
      }
  }
  return 0;
}

/* What a number changes, from two passes with the same gain[n][NX][NY]: with s the change of the state at the beginning of an
   interval, f that of its prediction at the end and d that of the innovation, ends = f - A s and outputs = -d - C (s + theta (f - s)),
   per step. Column `column` of ends[n][NX][count], outputs[n][NY][count], begin[NX][count]. states[n][NX], innovation[n][NY] of
   either pass, both[n][NY]: whether both have a sample. */
void difference_column(long n, long count, long column, double step, const double *transition, const double *output,
                       const double *gain, const double *share, const unsigned char *both, const double *states,
                       const double *others, const double *innovation, const double *late, double *ends, double *outputs,
                       double *begin) {
  double s[NX], f[NX], d[NY];
  const double inverse = 1.0 / step;
  for (int i = 0; i < NX; i++) begin[i * count + column] = (others[i] - states[i]) * inverse;
  for (long k = 0; k < n; k++) {
    const double *A = transition + k * NX * NX;
    for (int i = 0; i < NX; i++) s[i] = others[k * NX + i] - states[k * NX + i];
    for (int a = 0; a < NY; a++) d[a] = late[k * NY + a] - innovation[k * NY + a];
    for (int i = 0; i < NX; i++) {
      double moved = 0.0;
      for (int j = 0; j < NX; j++) moved += A[i * NX + j] * s[j];
      if (k + 1 < n) {
        f[i] = others[(k + 1) * NX + i] - states[(k + 1) * NX + i];
        for (int a = 0; a < NY; a++) f[i] -= gain[(k * NX + i) * NY + a] * d[a];
      } else
        f[i] = moved;
      ends[(k * NX + i) * count + column] = (f[i] - moved) * inverse;
    }
    for (int a = 0; a < NY; a++) {
      double y = 0.0;
      for (int i = 0; i < NX; i++) y += output[a * NX + i] * (s[i] + share[k * NY + a] * (f[i] - s[i]));
      outputs[(k * NY + a) * count + column] = both[k * NY + a] ? (-d[a] - y) * inverse : 0.0;
    }
  }
}
