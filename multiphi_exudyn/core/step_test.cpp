#include "step_test.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace multiphi {

namespace {

double product(const double* row, const Vector& x, Index first, Index end) {
    double total = 0.0;
    for (Index i = first; i < end; ++i) total += row[i] * x[i];
    return total;
}

}  // namespace

StepTest::StepTest(StepConditions conditions, double step, double rounding, SolverState state)
    : conditions_(std::move(conditions)), step_(step), rounding_(rounding), state_(std::move(state)),
      size_(static_cast<int>(conditions_.norm.cols() / 3)), width_(static_cast<int>(conditions_.rows.cols())),
      start_(Vector::Zero(width_)), end_(Vector::Zero(width_)), time_(std::numeric_limits<double>::quiet_NaN()),
      announced_end_(std::numeric_limits<double>::quiet_NaN()) {
    end_[3 * size_] = 1.0;
}

void StepTest::begin(double time, const Vector& x, bool all_armed) {
    const int unchanged = 3 * size_ + 1 + conditions_.points;
    time_ = time;
    start_ = x;
    end_.segment(unchanged, conditions_.held) = x.segment(unchanged, conditions_.held);
    speed_ = norm_of(x);
    clearance_ = all_armed ? std::numeric_limits<double>::infinity() : -std::numeric_limits<double>::infinity();
    for (Index k = conditions_.first_at_start; all_armed && k < conditions_.rows.rows(); ++k)
        clearance_ = std::min(clearance_, product(conditions_.rows.row(k).data(), x, 0, width_));
}

void StepTest::set_end_channels(double t, const Vector& channels) {
    end_.tail(channels.size()) = channels;
    announced_end_ = t;
}

bool StepTest::is_step_clear(double t) {
    if (!(std::abs(t - time_ - step_) <= rounding_)) return false;
    if (conditions_.channels > 0 && announced_end_ != t) return false;
    for (int i = 0; i < size_; ++i) {
        end_[i] = state_.displacement[i];
        end_[size_ + i] = state_.velocity[i];
        end_[2 * size_ + i] = state_.acceleration[i];
    }
    for (int k = 0; k < conditions_.points; ++k) end_[3 * size_ + 1 + k] = state_.multipliers[state_.point_forces[k]];
    const double speed = norm_of(end_);
    double limit = std::max(speed, speed_);
    if (conditions_.has_point_forces) limit += half_change();
    if (!(clearance_ > limit)) return false;
    double clearance = std::numeric_limits<double>::infinity();
    for (int k = 0; k < static_cast<int>(conditions_.rows.rows()); ++k) {
        const double value = product(conditions_.rows.row(k).data(), end_, 0, width_);
        if (k < conditions_.end_count && !(value > limit)) return false;
        if (k >= conditions_.first_at_start) clearance = std::min(clearance, value);
    }
    std::swap(start_, end_);
    time_ = t;
    clearance_ = clearance;
    speed_ = speed;
    return true;
}

Vector StepTest::start() const { return start_.head(3 * size_ + 1 + conditions_.points); }

double StepTest::norm_of(const Vector& x) const {
    double square = 0.0;
    for (Index k = 0; k < conditions_.norm.rows(); ++k) {
        const double value = product(conditions_.norm.row(k).data(), x, 0, 3 * size_);
        square += value * value;
    }
    return std::sqrt(square);
}

// The largest difference of a row's share of f between its mean and either end of a step.
double StepTest::half_change() const {
    const int first = 3 * size_ + 1;
    double largest = 0.0;
    for (Index k = 0; k < conditions_.rows.rows(); ++k) {
        double total = 0.0;
        for (int i = first; i < first + conditions_.points; ++i)
            total += conditions_.rows(k, i) * (end_[i] - start_[i]);
        largest = std::max(largest, 0.5 * std::abs(total));
    }
    return largest;
}

}  // namespace multiphi
