// Start projection: whether a start touches nothing, in coordinates of a complete base.
//
//     h.y - b > a |h| (|y| + |t y'|)                            of a gap that is not near zero
//
// Most starts touch nothing: they need none of the checks of every contact.
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

class StartProjection {
  public:
    // sizes: |Phi|^T |M| (n, n), whose products bound the round-off of y and y'. times: t (n,) [s]. units, bounds:
    // h / |h| (l, n) and b / |h| (l,) of every link. near: a.
    StartProjection(Matrix sizes, Vector times, Matrix units, Vector bounds, double near);

    // Whether no gap is near zero at y = Phi^T M x and y' = Phi^T M x' (n,), which are cleared of round-off.
    bool is_far(const double* x, const double* x_t, double* y, double* y_t) const;

    int size() const { return static_cast<int>(times_.size()); }

  private:
    Matrix sizes_;
    Vector row_sums_;  // of sizes
    Vector times_;
    Matrix units_;
    Vector bounds_;
    double near_;
};

}  // namespace multiphi
