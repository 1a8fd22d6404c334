/* The loops of benchmarks/engine.py written by hand: what a careful engineer would write, constants out of the loops.
 * Each run records its largest |error| at and between the control instants, and nothing else.
 *   ref: ticks x 4 (position ... jerk);  p: one column of parameters a run, lanes last;  out: one figure a run. */
#include <math.h>

#ifndef LANES
#define LANES 1
#endif
#define EACH for (int l = 0; l < LANES; l++)
#define P(i) p[(i) * LANES + l]
/* in lanes, gcc would join sin and cos of one angle into a call that it cannot vectorise */
#define COS(a) (LANES > 1 ? sin((a) + 1.5707963267948966) : cos(a))

/* Actuator: gains b e d s of two rows, then the plant's parameters in the order of the study, then the load. */
void emla(long ticks, long steps, double T, const double *ref, const double *restrict p, double *restrict out) {
  double x0[LANES], x1[LANES], x2[LANES], t1[LANES], t2[LANES], u[LANES], most[LANES];
  double M[LANES], iM[LANES], rm[LANES], loss[LANES], ir[LANES], ivs[LANES], iPs[LANES], iT[LANES];
  EACH {
    double r = P(8), J = P(12), m = P(17);
    M[l] = J / r + r * m; iM[l] = 1 / M[l]; rm[l] = r * m * iM[l]; loss[l] = P(10) / P(9) + P(11);
    ir[l] = 1 / r; ivs[l] = 1 / P(15); iPs[l] = 1 / P(16); iT[l] = 1 / P(19);
    x0[l] = ref[0]; x1[l] = x2[l] = t1[l] = t2[l] = most[l] = 0;
  }
  double h = T / steps;
#define RATE(o, a, b, c) \
  double o##0, o##1, o##2; { \
    double f = P(20) + P(14) * tanh((b) * ivs[l]), s = loss[l] * tanh(f * (b) * iPs[l]); \
    o##0 = (b); \
    o##1 = (P(18) * (c) - P(13) * ir[l] * (b) - P(8) * (1 + s) * f) / (1 + s * rm[l]) * iM[l]; \
    o##2 = (u[l] - (c)) * iT[l]; }
  for (long k = 0; k < ticks; k++) {
    const double *r = ref + 4 * k;
    EACH {
      double q1 = x0[l] - r[0], v = r[1] - 0.5 * (P(0) + P(1) * t1[l]) * q1;
      double q2 = x1[l] - v, w = -0.5 * (P(4) + P(5) * t2[l]) * q2;
      t1[l] += T * (0.5 * P(1) * P(2) * q1 * q1 - P(2) * P(3) * t1[l]);
      t2[l] += T * (0.5 * P(5) * P(6) * q2 * q2 - P(6) * P(7) * t2[l]);
      u[l] = w > 77 ? 77 : w < -77 ? -77 : w;
      double e = fabs(q1);
      most[l] = e > most[l] ? e : most[l];
    }
    for (long i = 1; i <= steps; i++) {
      double tau = i * h, goal = r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * r[3] / 6));
      EACH {
        RATE(a, x0[l], x1[l], x2[l])
        RATE(b, x0[l] + h / 2 * a0, x1[l] + h / 2 * a1, x2[l] + h / 2 * a2)
        RATE(c, x0[l] + h / 2 * b0, x1[l] + h / 2 * b1, x2[l] + h / 2 * b2)
        RATE(d, x0[l] + h * c0, x1[l] + h * c1, x2[l] + h * c2)
        x0[l] += h / 6 * (a0 + 2 * b0 + 2 * c0 + d0);
        x1[l] += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1);
        x2[l] += h / 6 * (a2 + 2 * b2 + 2 * c2 + d2);
        double e = fabs(x0[l] - goal);
        most[l] = e > most[l] ? e : most[l];
      }
    }
  }
  EACH out[l] = most[l];
#undef RATE
}

/* A lift joint driven by a cylinder: k1 k2, then mass·g·l, J, m·l², damping, Coulomb torque, its speed, lever a·b, c. */
void joint(long ticks, long steps, double T, const double *ref, const double *restrict p, double *restrict out) {
  double x0[LANES], x1[LANES], u[LANES], most[LANES], iv[LANES];
  EACH { x0[l] = ref[0]; x1[l] = most[l] = 0; iv[l] = 1 / P(7); }
  double h = T / steps;
#define RATE(o, a, b) \
  double o##0, o##1; { \
    double s = sin(a), c = COS(a), arm = P(8) * s / sqrt(P(9) + 2 * P(8) * c); \
    o##0 = (b); \
    o##1 = (arm * u[l] - P(2) * c - P(5) * (b) - P(6) * tanh((b) * iv[l])) / (P(3) + P(4) * s * s); }
  for (long k = 0; k < ticks; k++) {
    const double *r = ref + 4 * k;
    EACH {
      double q1 = x0[l] - r[0], q2 = x1[l] - (r[1] - 0.5 * P(0) * q1);
      u[l] = -0.5 * P(1) * q2;
      double e = fabs(q1);
      most[l] = e > most[l] ? e : most[l];
    }
    for (long i = 1; i <= steps; i++) {
      double tau = i * h, goal = r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * r[3] / 6));
      EACH {
        RATE(a, x0[l], x1[l])
        RATE(b, x0[l] + h / 2 * a0, x1[l] + h / 2 * a1)
        RATE(c, x0[l] + h / 2 * b0, x1[l] + h / 2 * b1)
        RATE(d, x0[l] + h * c0, x1[l] + h * c1)
        x0[l] += h / 6 * (a0 + 2 * b0 + 2 * c0 + d0);
        x1[l] += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1);
        double e = fabs(x0[l] - goal);
        most[l] = e > most[l] ? e : most[l];
      }
    }
  }
  EACH out[l] = most[l];
}
