/* The number that all generated C calculates with: a double, or LANES of them side by side, one for each of as many runs that share
   the steps of the integrator. R(a): a number that is the same in all. */
#include <math.h>
#include <string.h>

#if LANES == 1
typedef double real;
#define R(a) (a)
#define boom_exp exp
#define boom_log log
#define boom_sin sin
#define boom_cos cos
#define boom_tan tan
#define boom_asin asin
#define boom_acos acos
#define boom_atan atan
#define boom_sqrt sqrt
#define boom_fabs fabs
#define boom_pow pow
#define boom_atan2 atan2
#define boom_copysign copysign
#define boom_if(condition) ((double)(condition))
#define boom_choose(condition, a, b) ((condition) ? (a) : (b))
#define boom_and(a, b) ((double)((a) && (b)))
#define boom_or(a, b) ((double)((a) || (b)))
static inline double boom_largest(real a) { return a; }
static inline int boom_any(real a) { return a != 0.0; }
#else
typedef double real __attribute__((vector_size(8 * LANES)));
typedef long long flags __attribute__((vector_size(8 * LANES)));
#define R(a) ((real){0} + (a))
#define boom_if(condition) boom_choose(condition, R(1.0), R(0.0))
#define boom_and(a, b) boom_if(((a) != R(0.0)) & ((b) != R(0.0)))
#define boom_or(a, b) boom_if(((a) != R(0.0)) | ((b) != R(0.0)))
static inline real boom_choose(flags condition, real a, real b) {
  return (real)((condition & (flags)a) | (~condition & (flags)b));
}
#define EACH(name, function) \
  static inline real name(real a) { real r; for (int l = 0; l < LANES; l++) r[l] = function(a[l]); return r; }
#define EACH_PAIR(name, function) \
  static inline real name(real a, real b) { real r; for (int l = 0; l < LANES; l++) r[l] = function(a[l], b[l]); return r; }
EACH(boom_sqrt, sqrt)
EACH(boom_fabs, fabs)
EACH(boom_tan, tan)
EACH(boom_asin, asin)
EACH(boom_acos, acos)
EACH(boom_atan, atan)
EACH_PAIR(boom_atan2, atan2)
EACH_PAIR(boom_copysign, copysign)
#if LANES == 4 && defined(__x86_64__) && defined(__AVX2__) && defined(__GLIBC__)
/* glibc's own, four at a time, exact to 4 units of the last place */
real _ZGVdN4v_exp(real), _ZGVdN4v_log(real), _ZGVdN4v_sin(real), _ZGVdN4v_cos(real), _ZGVdN4vv_pow(real, real);
#define boom_exp _ZGVdN4v_exp
#define boom_log _ZGVdN4v_log
#define boom_sin _ZGVdN4v_sin
#define boom_cos _ZGVdN4v_cos
#define boom_pow _ZGVdN4vv_pow
#else
EACH(boom_exp, exp)
EACH(boom_log, log)
EACH(boom_sin, sin)
EACH(boom_cos, cos)
EACH_PAIR(boom_pow, pow)
#endif
static inline int boom_any(real a) {
  int any = 0;
  for (int l = 0; l < LANES; l++) any |= a[l] != 0.0;
  return any;
}
/* NaN if one is. */
static inline double boom_largest(real a) {
  double m = a[0];
  for (int l = 1; l < LANES; l++) if (m == m && !(a[l] <= m)) m = a[l];
  return m;
}
#endif

static inline real boom_min(real a, real b) { return boom_choose(a < b, a, b); }
static inline real boom_max(real a, real b) { return boom_choose(a > b, a, b); }
static inline real boom_sign(real a) { return boom_if(a > R(0.0)) - boom_if(a < R(0.0)); }
/* Exact to 1e-16 absolute, as its use in the equations wants, and half as slow as libm's, which is exact near zero too. */
static inline real boom_tanh(real a) { return R(1.0) - R(2.0) / (boom_exp(R(2.0) * a) + R(1.0)); }
/* Lanes lie side by side in memory, at no particular address. */
static inline real boom_load(const double *a) { real r; memcpy(&r, a, sizeof r); return r; }
static inline void boom_store(double *a, real r) { memcpy(a, &r, sizeof r); }
