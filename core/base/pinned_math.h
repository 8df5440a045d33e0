#pragma once

// Sine, cosine and arc tangent with the same bits on every machine. Those of the C library choose
// their code by the processor at hand and differ in the last bit; these are additions,
// multiplications and divisions alone, in a fixed order and without fused steps. What a result's
// bytes depend on is computed with these.

namespace lightkiln {

struct SinCos {
  double sin, cos;
};
// Of an angle in radians of magnitude up to 1e5, each to within 2^-52 for angles of a few turns.
SinCos pinned_sin_cos(double angle_rad);

// The angle of (x, y) from the x axis, -pi to pi, to within 2^-51; 0 for (0, 0). Finite arguments.
double pinned_atan2(double y, double x);

}  // namespace lightkiln
