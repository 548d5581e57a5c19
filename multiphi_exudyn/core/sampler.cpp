#include "sampler.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "truncation.hpp"

namespace multiphi {

namespace {

constexpr int restart = 32;     // samples between exact exponentials: so many round-offs add up
constexpr double even = 4e-16;  // of the last time, by which evenly spaced times may be off

}  // namespace

Sampler::Sampler(std::shared_ptr<Levels> levels, std::shared_ptr<const Trajectory> trajectory)
    : levels_(std::move(levels)),
      trajectory_(std::move(trajectory)),
      inputs_(levels_->excitation()) {}

int Sampler::segment_at(double time, Side side) const {
    const auto first = trajectory_->instants.begin();
    const auto last = first + static_cast<std::ptrdiff_t>(trajectory_->segments.size());
    const auto after = side == Side::left ? std::lower_bound(first, last, time) : std::upper_bound(first, last, time);
    return std::max(static_cast<int>(after - first) - 1, 0);
}

// Sets up the motion of a segment once more, from the state at its start.
void Sampler::begin_segment(int segment) {
    if (segment == begun_) return;
    const Segment& kept = trajectory_->segments[segment];
    const Level& level = levels_->level(trajectory_->keys[kept.level]);
    const int n = level.width();
    const double* start = trajectory_->coordinates.data() + kept.coordinates;
    state_.enter(level);
    state_.displacement = Vector::Map(start, n);
    state_.velocity = Vector::Map(start + n, n);
    if (inputs_.count() > 0) {
        inputs_.set(kept.interval, kept.age, 0.0, 1.0);
        inputs_.set_horizon(kept.horizon);
    }
    motion_.begin(state_, inputs_);
    begun_ = segment;
}

const Motion& Sampler::motion(int segment) {
    begin_segment(segment);
    return motion_;
}

ComplexMatrix Sampler::shapes() const {
    const Level& level = motion_.level();
    const int r = level.modes(), moving = r + level.prescribed(), free = motion_.free_size();
    ComplexMatrix result = ComplexMatrix::Zero(level.width(), motion_.size());
    for (int j = 0; j < free; ++j)
        for (int i = 0; i < r; ++i) result(i, j) = level.response().shapes(j, i);
    for (int j = free; j < motion_.size(); ++j)
        for (int i = 0; i < moving; ++i) result(i, j) = motion_.forced_shapes()(j - free, i);
    return result;
}

void Sampler::states(const int* segments, const double* after, int count, int width, double* result) {
    std::fill(result, result + 2 * static_cast<std::size_t>(count) * width, 0.0);
    for (int k = 0; k < count; ++k) {
        double* displacement = result + static_cast<std::size_t>(k) * width;
        double* velocity = result + (static_cast<std::size_t>(count) + k) * width;
        const Segment& kept = trajectory_->segments[segments[k]];
        if (after[k] == 0.0) {
            const int n = trajectory_->widths[kept.level];
            const double* start = trajectory_->coordinates.data() + kept.coordinates;
            std::copy(start, start + n, displacement);
            std::copy(start + n, start + 2 * n, velocity);
            continue;
        }
        begin_segment(segments[k]);
        motion_.state_at(after[k], at_.displacement, at_.velocity);
        std::copy(at_.displacement.begin(), at_.displacement.end(), displacement);
        std::copy(at_.velocity.begin(), at_.velocity.end(), velocity);
    }
}

// The step [s] of times that are evenly spaced and ascending, else zero.
double Sampler::even_step(const double* times, int count) const {
    const double step = (times[count - 1] - times[0]) / std::max(count - 1, 1);
    for (int k = 0; k < count; ++k)
        if (std::abs(times[k] - (times[0] + k * step)) > even * times[count - 1]) return 0.0;
    return std::max(step, 0.0);
}

void Sampler::values(const double* times, int count, Side side, const Matrix& rows, double* result) {
    if (count == 0) return;
    const int width = static_cast<int>(rows.cols() / 2), segments = static_cast<int>(trajectory_->segments.size());
    const double step = even_step(times, count);
    for (int k = 0; k < count;) {
        const int i = segment_at(times[k], side);
        const double end = i + 1 < segments ? trajectory_->instants[i + 1] : std::numeric_limits<double>::infinity();
        int last = k + 1;
        while (last < count && times[k] < times[last] && times[last] < end) ++last;
        begin_segment(i);
        const Level& level = motion_.level();
        const Exponentials& basis = motion_.basis();
        const int p = motion_.size();
        const double* row = rows.row(trajectory_->segments[i].level).data();
        coefficients_.resize(p);
        phi_.resize(p);
        motion_.coefficients(row, row + width, coefficients_.data());
        double constant = row[2 * width];
        for (int c = level.modes() + level.prescribed(); c < level.width(); ++c) constant += row[c] * state_.displacement[c];
        const bool is_even = step > 0.0 && last - k > 1;
        if (is_even) {
            factors_.resize(p);
            basis.evaluate(step, 1.0, factors_.data());
        }
        for (int s = k; s < last; ++s) {
            const double t = times[s] - trajectory_->instants[i];
            if (!is_even || (s - k) % restart == 0) {
                basis.evaluate(t, phi_.data());
            } else {
                for (int j = 0; j < p; ++j) {
                    if (basis.powers[j] > 0)
                        phi_[j] = phi_[j - 1] * (t / basis.unit);
                    else
                        phi_[j] = product(phi_[j], factors_[j]);
                }
            }
            double value = constant;
            for (int j = 0; j < p; ++j)
                value += coefficients_[j].real() * phi_[j].real() - coefficients_[j].imag() * phi_[j].imag();
            result[s] = value;
        }
        k = last;
    }
}

Works Sampler::works(const std::vector<int>& segments) {
    Works total;
    for (const int segment : segments) {
        begin_segment(segment);
        const double duration = trajectory_->instants[segment + 1] - trajectory_->instants[segment];
        total += work_integrals_.integrate(state_, inputs_, duration, trajectory_->segments[segment].entry_work);
    }
    return total;
}

void Sampler::sizes(double end, double& mean_square, double& largest_energy) {
    MotionSize size;
    const double first = trajectory_->instants.front();
    size.begin(first, end, 0.0);
    for (int k = 0; k < MotionSize::samples; ++k) {
        const bool is_last = k == MotionSize::samples - 1;
        const double t = is_last ? end : first + (end - first) * k / (MotionSize::samples - 1);
        const int i = segment_at(t, Side::right);
        begin_segment(i);
        size.add_sample(motion_, t - trajectory_->instants[i], k == 0 || is_last ? 0.5 : 1.0, true);
    }
    mean_square = size.mean_square();
    largest_energy = size.largest_energy();
}

}  // namespace multiphi
