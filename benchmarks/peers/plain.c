/* Copyright 2026 The linkage_ros authors
   SPDX-License-Identifier: Apache-2.0

   The textbook closed form of the four-bar with the same ten results as linkage_ros gives. It
   fails at change points. ivdep: the rows of out do not overlap, which a compiler cannot know;
   without that it would not use vectors. */
#include <math.h>

/* k: r b c dx dy, mass, inertia and distance of centre of coupler and rocker, g, side of the
   coupler-rocker pin */
void four_bar(long n, const double *k, const double *alpha, double w, double *out)
{
    double r = k[0], b = k[1], c = k[2], dx = k[3], dy = k[4], m2 = k[5], j2 = k[6], s2 = k[7];
    double m3 = k[8], j3 = k[9], s3 = k[10], g = k[11], side = k[12];
#pragma GCC ivdep
    for (long i = 0; i < n; i++) {
        double ca = cos(alpha[i]), sa = sin(alpha[i]);
        double zx = dx - r * ca, zy = dy - r * sa, square = zx * zx + zy * zy;
        double u = (b * b - c * c + square) / (2 * square);
        double v = side * sqrt(b * b / square - u * u);
        double bx = zx * u - zy * v, by = zx * v + zy * u, cx = bx - zx, cy = by - zy;
        double det = 1 / (bx * cy - by * cx);
        double k2 = -r * (ca * cy - sa * cx) * det, k3 = -r * (ca * by - sa * bx) * det;
        double w2 = k2 * w, w3 = k3 * w;
        double fx = r * w * w * ca + w2 * w2 * bx - w3 * w3 * cx;
        double fy = r * w * w * sa + w2 * w2 * by - w3 * w3 * cy;
        double e2 = (fx * cx + fy * cy) * det, e3 = (fx * bx + fy * by) * det;
        double p = s2 / b, q = s3 / c;
        double vx = -r * sa - p * k2 * by, vy = r * ca + p * k2 * bx;
        double ax = -r * w * w * ca - p * (w2 * w2 * bx + e2 * by);
        double ay = -r * w * w * sa + p * (e2 * bx - w2 * w2 * by);
        out[i] = alpha[i], out[n + i] = atan2(by, bx), out[2 * n + i] = atan2(cy, cx);
        out[3 * n + i] = w, out[4 * n + i] = w2, out[5 * n + i] = w3;
        out[6 * n + i] = 0, out[7 * n + i] = e2, out[8 * n + i] = e3;
        out[9 * n + i] = m2 * (ax * vx + (ay + g) * vy) + j2 * k2 * e2
            + k3 * e3 * (j3 + m3 * s3 * s3) + m3 * g * q * k3 * cx;
    }
}
