#include "forced_response.hpp"

#include <algorithm>
#include <cmath>

#include "particular_solutions.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double coinciding = 2e-2;  // of |s|: poles closer than this are solved together

using Row = Eigen::Ref<const Eigen::RowVectorXcd>;  // of a matrix, not copied

Complex mirror(Complex z, bool mirrored) { return mirrored ? std::conj(z) : z; }

}  // namespace

struct ForcedResponse::Load {
    const ModalResponse& response;
    Complex rate;  // mu
    const ComplexMatrix& forces;
    int degree;
    double unit;
    const double *displacement, *velocity;

    bool acts_on(int mode) const {
        for (int d = 0; d <= degree; ++d) {
            if (forces(d, mode) != 0.0) return true;
        }
        return false;
    }

    // |A eta + B eta'|: the size of an exponential in the total motion.
    double motion_of_exponential(int j) const {
        if (displacement == nullptr) return 0.0;
        Complex total = 0.0;
        for (int i = response.reached[j].first; i < response.reached[j].end; ++i) {
            total += response.from_displacement(j, i) * displacement[i] + response.from_velocity(j, i) * velocity[i];
        }
        return modulus(total);
    }
};

int ForcedResponse::compute(const ModalResponse& response, Complex rate, const ComplexMatrix& forces, int degree,
                            double unit, const double* displacement, const double* velocity) {
    const Load load{response, rate, forces, degree, unit, displacement, velocity};
    modes_ = response.modes;
    count_ = 0;
    lengthen(1);
    if (static_cast<int>(input_.size()) < degree + 1) input_.resize(degree + 1);
    for (int i = 0; i < modes_; ++i) {
        if (response.uncoupled[i] && load.acts_on(i)) force_mode(load, i);
    }
    for (int j = 0; j < response.basis.size(); ++j) {
        if (!response.poles[j]) continue;
        force_pole(load, j, false);
        if (rate != 0.0) force_pole(load, j, true);
    }
    for (const Chain& chain : response.chains) {
        force_chain(load, chain, false);
        force_chain(load, chain, true);
    }
    return count_;
}

// eta'' + 2 delta eta' + omega^2 eta = p: poles -delta +- (delta^2 - omega^2)^(1/2), apart or together.
void ForcedResponse::force_mode(const Load& load, int mode) {
    const double square = load.response.squares[mode], delta = load.response.half_damping[mode];
    const double difference = delta * delta - square, root = std::sqrt(std::abs(difference));
    const bool is_real = load.rate == 0.0 && difference < 0.0;
    const double near = square == 0.0 ? round_off::slow * std::max(1.0 / load.unit, modulus(load.rate))
                                      : coinciding * std::sqrt(std::abs(square));
    if (2.0 * root <= near) {
        for (int d = 0; d <= load.degree; ++d) input_[d] = load.forces(d, mode);
        const int count = second_order(square, delta, load.rate, input_.data(), load.degree, load.unit, w_);
        add_to_mode(mode, count, false);
        return;
    }
    const Complex fast = difference > 0.0 ? Complex(-delta - root, 0.0) : Complex(-delta, -root);
    const Complex slow = square / std::norm(fast) * std::conj(fast);
    const double motion =
        load.displacement == nullptr ? 0.0 : std::abs(load.displacement[mode]) + std::abs(load.velocity[mode]) / root;
    const Complex weight = difference > 0.0 ? Complex(0.5 / root, 0.0) : Complex(0.0, -0.5 / root);  // of the slow pole
    for (const bool is_fast : {false, true}) {
        for (int d = 0; d <= load.degree; ++d) {
            const Complex force = load.forces(d, mode), part = is_real ? Complex(2.0 * force.real(), 0.0) : force;
            input_[d] = (is_fast ? -weight : weight) * part;
        }
        const Complex distance = (is_fast ? fast : slow) - load.rate;
        const int count = first_order(distance, input_.data(), load.degree, load.unit, motion, w_);
        add_to_mode(mode, count, is_real);
        if (is_real) break;
    }
}

// w' = (lambda - mu) w + B p / 2 along V, with conj(lambda), conj(B), conj(V) where `mirrored`; of both where mu = 0.
void ForcedResponse::force_pole(const Load& load, int j, bool mirrored) {
    const ModalResponse& response = load.response;
    const Index first = response.reached[j].first, size = std::max<Index>(0, response.reached[j].end - first);
    const bool is_real = load.rate == 0.0;
    const Row weights = response.from_velocity.row(j).segment(first, size);
    for (int d = 0; d <= load.degree; ++d) {
        const Row forces = load.forces.row(d).segment(first, size);
        if (is_real) {
            input_[d] = weights.cwiseProduct(forces.real()).sum();
        } else if (mirrored) {
            input_[d] = 0.5 * weights.conjugate().cwiseProduct(forces).sum();
        } else {
            input_[d] = 0.5 * weights.cwiseProduct(forces).sum();
        }
    }
    const Complex distance = mirror(response.basis.rates[j], mirrored) - load.rate;
    const bool far = is_far(modulus(distance), load.degree, load.unit);
    const double motion = far ? 0.0 : load.motion_of_exponential(j);
    const int count = first_order(distance, input_.data(), load.degree, load.unit, motion, w_);
    lengthen(count);
    const Row shapes = response.shapes.row(j).segment(first, size);
    Eigen::Map<ComplexMatrix> x(x_.data(), count_, modes_);
    for (int k = 0; k < count; ++k) {
        if (is_real) {
            x.row(k).segment(first, size).real() += (w_[k] * shapes).real();
        } else if (mirrored) {
            x.row(k).segment(first, size) += w_[k] * shapes.conjugate();
        } else {
            x.row(k).segment(first, size) += w_[k] * shapes;
        }
    }
}

// The last component first: each of the others is also forced by the later ones.
void ForcedResponse::force_chain(const Load& load, const Chain& chain, bool mirrored) {
    const int m = chain.size();
    int highest = load.degree;
    if (static_cast<int>(chain_w_.size()) < m) chain_w_.resize(m);
    for (int i = m - 1; i >= 0; --i) {
        if (static_cast<int>(input_.size()) < highest + 1) input_.resize(highest + 1);
        for (int d = 0; d <= highest; ++d) {
            Complex push = 0.0;
            for (int j = 0; j < modes_ && d <= load.degree; ++j) {
                push += 0.5 * mirror(chain.pushes(i, j), mirrored) * load.forces(d, j);
            }
            for (int k = i + 1; k < m; ++k) push += mirror(chain.mixing(i, k), mirrored) * chain_w_[k][d];
            input_[d] = push;
        }
        const Complex distance = mirror(chain.mixing(i, i), mirrored) - load.rate;
        const int count = first_order(distance, input_.data(), highest, load.unit, 0.0, chain_w_[i]);
        highest = std::max(highest, count - 1);
        std::fill(chain_w_[i].begin() + count, chain_w_[i].end(), 0.0);
        for (int k = i; k < m; ++k) {  // all have the powers of the longest one
            if (static_cast<int>(chain_w_[k].size()) < highest + 1) chain_w_[k].resize(highest + 1);
        }
        lengthen(count);
        for (int d = 0; d < count; ++d) {
            Complex* row = x_.data() + static_cast<std::size_t>(d) * modes_;
            for (int j = 0; j < modes_; ++j) row[j] += chain_w_[i][d] * mirror(chain.shapes(i, j), mirrored);
        }
    }
}

void ForcedResponse::add_to_mode(int mode, int count, bool is_real) {
    lengthen(count);
    for (int k = 0; k < count; ++k) {
        x_[static_cast<std::size_t>(k) * modes_ + mode] += is_real ? Complex(w_[k].real(), 0.0) : w_[k];
    }
}

void ForcedResponse::lengthen(int count) {
    if (count <= count_) return;
    const std::size_t first = static_cast<std::size_t>(count_) * modes_, end = static_cast<std::size_t>(count) * modes_;
    if (x_.size() < end) x_.resize(end);
    std::fill(x_.begin() + first, x_.begin() + end, 0.0);
    count_ = count;
}

}  // namespace multiphi
