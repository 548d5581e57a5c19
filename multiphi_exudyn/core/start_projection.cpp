#include "start_projection.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "orthonormal.hpp"

namespace multiphi {

StartProjection::StartProjection(Matrix sizes, Vector times, Matrix units, Vector bounds, double near)
    : sizes_(std::move(sizes)),
      row_sums_(sizes_.rowwise().sum()),
      times_(std::move(times)),
      units_(std::move(units)),
      bounds_(std::move(bounds)),
      near_(near) {}

bool StartProjection::is_far(const double* x, const double* x_t, double* y, double* y_t) const {
    const int n = size();
    clear_products(y, x, sizes_.data(), row_sums_.data(), n);
    clear_products(y_t, x_t, sizes_.data(), row_sums_.data(), n);
    double squares = 0.0;
    for (int i = 0; i < n; ++i) squares += (y_t[i] * times_[i]) * (y_t[i] * times_[i]);
    const double length = norm(y, n) + std::sqrt(squares);
    for (Index link = 0; link < bounds_.size(); ++link) {
        const double gap = scalar_product(units_.row(link).data(), y, n) - bounds_[link];
        if (!(gap > near_ * length)) return false;
    }
    return length < std::numeric_limits<double>::infinity();
}

}  // namespace multiphi
