#include "secular_equation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "orthonormal.hpp"

namespace multiphi {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double equal = 4 * epsilon;  // of d: nearer ones are equal
constexpr double absent = 1e-16;       // of |p| with weights 1 / d: smaller components are deflated
constexpr double noise = 2e-14;        // of |p|: round-off of modes without motion in this direction
constexpr double rounded = 8.0;        // round-off of a sum, in units of the round-off of one term
constexpr double slow = 0.1;           // of the previous value: after a step with less progress the other kind is used
constexpr double far = 16.0;           // times the d beside the highest root: sums over larger d are power series of x
constexpr int orders = 14;             // of such a series, the next one is round-off

// The zero of c x^2 - a x + b that tends to b / a as c vanishes, if a > 0.
double smaller_zero(double c, double a, double b) {
    const double root = std::sqrt(std::abs(a * a - 4.0 * b * c));
    if (a > 0.0) return 2.0 * b / (a + root);
    return c != 0.0 ? (a - root) / (2.0 * c) : 0.0;
}

// The roots between neighbours of d, none of which has to be deflated.
class SecularEquation {
  public:
    // compliance: 1 / k.
    SecularEquation(const Vector& d, const Vector& p, double compliance, int count, int most_steps)
        : d_(d), p_(p), compliance_(compliance), m_(static_cast<int>(d.size())), count_(count), most_steps_(most_steps),
          near_(count + 1) {
        while (near_ < m_ && d_[near_] <= far * d_[count_]) ++near_;
        expand();
    }

    // The lowest `count` roots and their vectors of length one; none without convergence.
    std::optional<RankOneModes> solution() {
        RankOneModes result{Vector(count_), Matrix(count_, m_)};
        for (int i = 0; i < count_; ++i) {
            double* vector = result.vectors.row(i).data();
            const double lower = p_[i] * p_[i], upper = p_[i + 1] * p_[i + 1], gap = d_[i + 1] - d_[i];
            evaluate(i, i, 0.5 * gap, vector);
            const double rest = value_ - 2.0 * (upper - lower) / gap;
            int nearer = i;
            double start = 0.0;
            if (value_ >= 0.0) {
                start = smaller_zero(rest, rest * gap + lower + upper, lower * gap);
            } else {
                nearer = i + 1;
                start = -smaller_zero(-rest, lower + upper - rest * gap, upper * gap);
            }
            const double distance = refined_root(i, nearer, start, vector);
            if (distance == 0.0) return std::nullopt;
            result.values[i] = d_[nearer] + distance;
            const double scale = 1.0 / std::sqrt(slope_below_ + slope_above_);
            for (int j = 0; j < near_; ++j) vector[j] *= scale;
            for (int j = near_; j < m_; ++j) vector[j] = scale * p_[j] / (d_[j] - d_[nearer] - distance);
        }
        if (compliance_ == 0.0) remove_direction(p_.data(), result.vectors.data(), m_, count_);
        return result;
    }

  private:
    // Sets sums over the d from `near` on of p^2 / d (d_near / d)^k, the coefficients of powers of x / d_near.
    void expand() {
        for (int j = near_; j < m_; ++j) {
            const double ratio = d_[near_] / d_[j];
            double part = p_[j] * p_[j] / d_[j];
            for (int k = 0; k < orders; ++k) {
                series_[k] += part;
                part *= ratio;
            }
        }
    }

    // Sets the secular function at d_nearer + distance, its slopes, and the p / (d - x) up to `near`.
    void evaluate(int i, int nearer, double distance, double* ratios) {
        const double origin = d_[nearer];
        const double *d = d_.data(), *p = p_.data();
        for (int j = 0; j < near_; ++j) ratios[j] = p[j] / (d[j] - origin - distance);
        double below = 0.0, above = 0.0;
        slope_below_ = slope_above_ = 0.0;
        for (int j = 0; j <= i; ++j) {
            below += p[j] * ratios[j];
            slope_below_ += ratios[j] * ratios[j];
        }
        for (int j = i + 1; j < near_; ++j) {
            above += p[j] * ratios[j];
            slope_above_ += ratios[j] * ratios[j];
        }
        if (near_ < m_) {
            const double share = (origin + distance) / d[near_];
            double sum = 0.0, slope = 0.0;
            for (int k = orders - 1; k >= 0; --k) {
                slope = slope * share + sum;
                sum = sum * share + series_[k];
            }
            above += sum;
            slope_above_ += slope / d[near_];
        }
        size_ = rounded * (above - below) + compliance_;
        value_ = compliance_ + below + above;
    }

    // The distance of root i from its nearer neighbour, iterated from `start`; 0 without convergence.
    double refined_root(int i, int nearer, double start, double* ratios) {
        const double gap = d_[i + 1] - d_[i];
        double lowest = nearer == i ? 0.0 : -0.5 * gap, highest = nearer == i ? 0.5 * gap : 0.0;
        double distance = start, previous = 0.0;
        bool by_weight = true;
        for (int step = 0; step < most_steps_; ++step) {
            if (!(lowest < distance && distance < highest)) distance = 0.5 * (lowest + highest);
            evaluate(i, nearer, distance, ratios);
            const double value = value_, slope = slope_below_ + slope_above_;
            if (std::abs(value) < epsilon * (size_ + std::abs(distance) * slope)) return distance;
            (value < 0.0 ? lowest : highest) = distance;
            if (previous * value > 0.0 && std::abs(value) > slow * std::abs(previous)) by_weight = !by_weight;
            previous = value;
            const double down = d_[i] - d_[nearer] - distance, up = d_[i + 1] - d_[nearer] - distance;
            double rest = value - down * slope_below_ - up * slope_above_;
            if (by_weight) {
                const double own = nearer == i ? up : down, other = nearer == i ? -gap : gap;
                rest = value - own * slope - other * ratios[nearer] * ratios[nearer];
            }
            double change = smaller_zero(rest, (down + up) * value - down * up * slope, down * up * value);
            if (!(change * value < 0.0)) change = -value / slope;
            if (distance + change == distance) return distance;
            distance += change;
        }
        return 0.0;
    }

    const Vector& d_;
    const Vector& p_;
    double compliance_;
    int m_, count_, most_steps_;
    int near_;  // the first d of the series
    double series_[orders] = {};
    double value_ = 0.0, size_ = 0.0;  // of the secular function; its round-off over epsilon
    double slope_below_ = 0.0, slope_above_ = 0.0;
};

// A cluster of equal d, and the reflection of its coordinates that takes p to the first of them.
struct EqualModes {
    Index first, size;
    Vector normal;  // of the reflection, of length one; zero for none

    // Reflects these coordinates of vectors (k, m).
    void reflect(Matrix& vectors) const {
        const Vector shares = vectors.middleCols(first, size) * normal;
        vectors.middleCols(first, size) -= 2.0 * shares * normal.transpose();
    }
};

std::vector<EqualModes> equal_modes(const Vector& d, const Vector& p) {
    std::vector<EqualModes> result;
    for (Index first = 0, end = 1; first < d.size(); first = end++) {
        while (end < d.size() && !(d[end] - d[end - 1] > equal * d[end])) ++end;
        if (end - first == 1) continue;
        Vector normal = p.segment(first, end - first);
        const double length = normal.norm();
        if (length > 0.0) {
            normal /= length;
            normal[0] += std::copysign(1.0, normal[0]);
            normal.normalize();
        }
        result.push_back({first, end - first, normal});
    }
    return result;
}

// Which d remain (m,): p has a part in them that is not round-off. `reference` is the d beside the highest root.
std::vector<char> present(const Vector& d, const Vector& p, double reference) {
    double square = 0.0, weighted = 0.0;
    for (Index j = 0; j < d.size(); ++j) {
        square += p[j] * p[j];
        weighted += p[j] * p[j] / (d[j] + reference);
    }
    std::vector<char> result(static_cast<std::size_t>(d.size()));
    for (Index j = 0; j < d.size(); ++j) {
        const double own = p[j] * p[j];
        result[j] = own > noise * noise * square && own / (d[j] + reference) > absent * absent * weighted;
    }
    return result;
}

// Adds one more d, without a part in p, above the highest root of a spring, which is at most d_m + k |p|^2.
void add_bound(Vector& d, Vector& p, double stiffness) {
    const Index m = d.size();
    const double highest = d[m - 1], bound = highest + 2 * stiffness * p.squaredNorm();
    if (!(bound > highest * (1 + equal))) return;
    d.conservativeResize(m + 1);
    p.conservativeResize(m + 1);
    d[m] = bound;
    p[m] = 0.0;
}

}  // namespace

std::optional<RankOneModes> rank_one_modes(const Vector& d, const Vector& p, double stiffness, int count,
                                           int most_steps) {
    const Index m = d.size();
    const std::vector<EqualModes> clusters = equal_modes(d, p);
    Vector components = p;
    for (const EqualModes& cluster : clusters) {
        const double length = p.segment(cluster.first, cluster.size).norm();
        components.segment(cluster.first, cluster.size).setZero();
        components[cluster.first] = -std::copysign(length, p[cluster.first]);
    }
    std::vector<int> poles, deflated;
    const std::vector<char> is_present = present(d, components, d[std::min<Index>(count, m - 1)]);
    for (int j = 0; j < m; ++j) {
        if (is_present[j]) {
            poles.push_back(j);
        } else if (static_cast<int>(deflated.size()) < count) {
            deflated.push_back(j);
        }
    }
    if (deflated.empty() && count < m) return SecularEquation(d, p, 1 / stiffness, count, most_steps).solution();
    Vector given = d(poles), weights = components(poles);
    if (!poles.empty() && static_cast<int>(poles.size()) <= count && std::isfinite(stiffness)) {
        add_bound(given, weights, stiffness);
    }
    const int roots = std::min(count, static_cast<int>(given.size()) - 1);
    if (roots < 1 || roots + static_cast<int>(deflated.size()) < count) return std::nullopt;
    SecularEquation equation(given, weights, 1 / stiffness, roots, most_steps);
    const std::optional<RankOneModes> moved = equation.solution();
    if (!moved) return std::nullopt;
    Vector values(roots + static_cast<Index>(deflated.size()));
    values << moved->values, d(deflated);
    std::vector<int> order(static_cast<std::size_t>(values.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&values](int one, int other) { return values[one] < values[other]; });
    RankOneModes result{Vector(count), Matrix::Zero(count, m)};
    for (int k = 0; k < count; ++k) {
        result.values[k] = values[order[k]];
        if (order[k] < roots) {
            for (std::size_t j = 0; j < poles.size(); ++j) {
                result.vectors(k, poles[j]) = moved->vectors(order[k], static_cast<Index>(j));
            }
        } else {
            result.vectors(k, deflated[order[k] - roots]) = 1.0;
        }
    }
    for (const EqualModes& cluster : clusters) cluster.reflect(result.vectors);
    return result;
}

}  // namespace multiphi
