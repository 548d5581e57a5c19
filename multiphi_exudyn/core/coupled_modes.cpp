#include "coupled_modes.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "failure.hpp"
#include "motion_parts.hpp"
#include "uncoupled_modes.hpp"

namespace multiphi {

namespace {

using Modes = std::vector<int>;

// Modes by what moves them, and the motion of their parts.
struct CoupledModes {
    int modes;                        // r
    const Matrix& stiffness;          // S (r, r)
    const Matrix& damping;            // D (r, r)
    Modes free;                       // modes of zero frequency with damping
    Modes driven;                     // modes of zero frequency that move no other and are not damped
    MotionParts parts;
    ComplexMatrix shapes;             // eta = Re shapes y (r, k)
    ComplexMatrix velocities;         // eta' = Re velocities y (r, k)
    ComplexMatrix from_displacement;  // y = from_displacement eta (k, r)
    ComplexMatrix from_velocity;      //     + from_velocity eta'
    ComplexMatrix driving;            // of driven modes, eta'' = Re driving y (r, k); zero for others
    std::vector<char> uncoupled;      // (r,) driven modes that no part drives
};

// Unit vector (r,) of a mode.
ComplexVector unit(int modes, int mode) { return ComplexVector::Unit(modes, mode); }

bool is_zero(const ComplexMatrix& matrix) { return (matrix.array() == 0.0).all(); }

// Displacement (r,) of a mode by the shapes (r, k) of parts that have their start from maps (k, r).
ComplexVector start_of(int mode, const ComplexMatrix& shapes, const ComplexMatrix& maps) {
    return (shapes.row(mode) * maps).real().transpose().cast<Complex>();
}

CoupledModes coupled_modes(const Vector& squares, const Matrix& stiffness, const Matrix& damping) {
    const int r = static_cast<int>(squares.size());
    Modes moving, elastic, places, free, driven;  // places: of elastic modes among the moving ones
    for (int i = 0; i < r; ++i) {
        if (stiffness.col(i).isZero(0.0) && damping.col(i).isZero(0.0)) {
            driven.push_back(i);
            continue;
        }
        if (squares[i] != 0.0) {
            elastic.push_back(i);
            places.push_back(static_cast<int>(moving.size()));
        } else {
            free.push_back(i);
        }
        moving.push_back(i);
    }
    const Index e = static_cast<Index>(elastic.size()), m = static_cast<Index>(moving.size());
    const Vector scale = squares(elastic).cwiseAbs().cwiseSqrt();
    Matrix system = Matrix::Zero(e + m, e + m);
    for (Index k = 0; k < e; ++k) system(k, e + places[k]) = scale[k];
    system.bottomLeftCorner(m, e) = -stiffness(moving, elastic) * scale.cwiseInverse().asDiagonal();
    system.bottomRightCorner(m, m) = -damping(moving, moving);
    CoupledModes result{r, stiffness, damping, free, driven, motion_parts(system), {}, {}, {}, {}, {}, {}};
    const MotionParts& parts = result.parts;
    const int k = parts.size();
    result.shapes = result.velocities = result.driving = ComplexMatrix::Zero(r, k);
    result.from_displacement = result.from_velocity = ComplexMatrix::Zero(k, r);
    result.shapes(elastic, Eigen::all) = scale.cwiseInverse().cast<Complex>().asDiagonal() * parts.vectors.topRows(e);
    result.velocities(moving, Eigen::all) = parts.vectors.bottomRows(m);
    result.from_displacement(Eigen::all, elastic) = parts.inverse.leftCols(e) * scale.cast<Complex>().asDiagonal();
    result.from_velocity(Eigen::all, moving) = parts.inverse.rightCols(m);
    result.driving(driven, Eigen::all) = -(stiffness(driven, Eigen::all).cast<Complex>() * result.shapes +
                                           damping(driven, Eigen::all).cast<Complex>() * result.velocities);
    result.uncoupled.assign(r, false);
    for (const int mode : driven) result.uncoupled[mode] = is_zero(result.driving.row(mode));
    return result;
}

// Which components (k,) are slow: none if no zero-frequency mode moves with the components.
std::vector<char> slow_components(const CoupledModes& modes, double duration) {
    std::vector<char> slow(modes.parts.size(), false);
    const ComplexMatrix velocities = modes.velocities(modes.free, Eigen::all);
    if (is_zero(modes.driving) && is_zero(velocities)) return slow;
    for (const Range& part : modes.parts.groups) {
        slow[part.first] = part.end - part.first == 1 && is_slow(modes.parts.rates[part.first], duration);
    }
    return slow;
}

// The modes with these components (k,) of their parts only; a part is kept as a whole.
CoupledModes only(const CoupledModes& modes, const std::vector<char>& kept) {
    Modes places, place_of(kept.size(), 0);
    for (std::size_t k = 0; k < kept.size(); ++k) {
        place_of[k] = static_cast<int>(places.size());
        if (kept[k]) places.push_back(static_cast<int>(k));
    }
    const MotionParts& parts = modes.parts;
    MotionParts rest{parts.rates(places), parts.vectors(Eigen::all, places), parts.inverse(places, Eigen::all),
                     parts.mixing(places, places), {}};
    for (const Range& part : parts.groups) {
        if (kept[part.first]) {
            const int first = place_of[part.first];
            rest.groups.push_back({first, first + part.end - part.first});
        }
    }
    return {modes.modes, modes.stiffness, modes.damping, modes.free, modes.driven, rest,
            modes.shapes(Eigen::all, places), modes.velocities(Eigen::all, places),
            modes.from_displacement(places, Eigen::all), modes.from_velocity(places, Eigen::all),
            modes.driving(Eigen::all, places), modes.uncoupled};
}

// X (n, k) of X y' = rows y.
ComplexMatrix integral(const ComplexMatrix& rows, const MotionParts& parts) {
    for (const Complex& rate : parts.mixing.diagonal()) {
        if (rate == 0.0) throw NumericalFailure(Cause::cancelled_stiffness);
    }
    ComplexMatrix result = rows;
    for (int j = 0; j < parts.size(); ++j) {
        for (int k = 0; k < j; ++k) result.col(j) -= result.col(k) * parts.mixing(k, j);
        result.col(j) /= parts.mixing(j, j);
    }
    return result;
}

// Constant y (k, n) of 0 = T y + pushes.
ComplexMatrix steady_parts(const MotionParts& parts, const ComplexMatrix& pushes) {
    ComplexMatrix result = -pushes;
    for (int j = parts.size() - 1; j >= 0; --j) {
        for (int k = j + 1; k < parts.size(); ++k) result.row(j) -= parts.mixing(j, k) * result.row(k);
        result.row(j) /= parts.mixing(j, j);
    }
    return result;
}

// Adds the motion of the parts: their exponentials, each with the powers of its part.
void add_parts(MotionTerms& motion, const CoupledModes& modes) {
    for (const Range& part : modes.parts.groups) {
        const Complex rate = modes.parts.rates[part.first];
        const int m = part.end - part.first;
        const std::vector<ComplexMatrix> powers = modes.parts.powers(part);
        const ComplexMatrix from_displacement = modes.from_displacement.middleRows(part.first, m);
        const ComplexMatrix from_velocity = modes.from_velocity.middleRows(part.first, m);
        for (int i = 0; i < m; ++i) {
            for (std::size_t d = 0; d < powers.size(); ++d) {
                MotionTerm term(rate, static_cast<int>(d), modes.modes);
                term.pole = m == 1;
                term.shape = modes.shapes.col(part.first + i);
                term.from_displacement = (powers[d].row(i) * from_displacement).transpose();
                term.from_velocity = (powers[d].row(i) * from_velocity).transpose();
                motion.terms.push_back(term);
            }
        }
        if (m > 1) {
            const ComplexMatrix shapes = modes.shapes.middleCols(part.first, m).transpose();
            motion.chains.push_back({modes.parts.mixing.block(part.first, part.first, m, m), shapes, from_velocity});
        }
    }
}

// Adds the further motion of zero-frequency modes: a of damped ones, a + b t + p t^2 / 2 of driven ones.
void add_initial_drift(MotionTerms& motion, const CoupledModes& modes) {
    const int r = modes.modes;
    const ComplexMatrix velocities = modes.shapes * modes.parts.mixing;
    for (const int mode : modes.free) {
        MotionTerm term(0.0, 0, r);
        term.pole = true;
        term.shape = unit(r, mode);
        term.from_displacement = unit(r, mode) - start_of(mode, modes.shapes, modes.from_displacement);
        term.from_velocity = -start_of(mode, modes.shapes, modes.from_velocity);
        motion.terms.push_back(term);
    }
    for (const int mode : modes.driven) {
        MotionTerm constant(0.0, 0, r), linear(0.0, 1, r), square(0.0, 2, r);
        constant.shape = linear.shape = square.shape = unit(r, mode);
        constant.from_displacement = unit(r, mode) - start_of(mode, modes.shapes, modes.from_displacement);
        constant.from_velocity = -start_of(mode, modes.shapes, modes.from_velocity);
        linear.from_displacement = -start_of(mode, velocities, modes.from_displacement);
        linear.from_velocity = unit(r, mode) - start_of(mode, velocities, modes.from_velocity);
        square.from_force = 0.5 * unit(r, mode);
        motion.terms.insert(motion.terms.end(), {constant, linear, square});
        if (modes.uncoupled[mode]) {
            motion.uncoupled[mode] = true;
            continue;
        }
        Chain chain{ComplexMatrix::Zero(2, 2), ComplexMatrix::Zero(2, r), ComplexMatrix::Zero(2, r)};
        chain.mixing(0, 1) = 1.0;
        chain.shapes(0, mode) = 1.0;
        chain.pushes.row(0) = constant.from_velocity.transpose();
        chain.pushes.row(1) = linear.from_velocity.transpose();
        motion.chains.push_back(chain);
    }
}

// Adds the motion u + w t of damped zero-frequency modes under a constant force, with the parts that it moves.
void add_drift(MotionTerms& motion, const CoupledModes& modes) {
    const int r = modes.modes;
    const ComplexMatrix steady = steady_parts(modes.parts, modes.from_velocity(Eigen::all, modes.free));
    Matrix offset = (modes.shapes * steady).real();
    const Matrix velocity = (modes.velocities * steady).real();
    Matrix drift = Matrix::Zero(r, velocity.cols());
    for (const int mode : modes.free) {
        drift.row(mode) = velocity.row(mode);
        offset.row(mode).setZero();
    }
    for (const int mode : modes.driven) offset.row(mode).setZero();
    // acceleration of driven modes by the drift
    const Matrix driving = -(modes.stiffness(modes.driven, Eigen::all) * offset +
                             modes.damping(modes.driven, Eigen::all) * drift);
    for (MotionTerm& term : motion.terms) {
        const ComplexVector from_force = term.from_force;
        for (std::size_t k = 0; k < modes.free.size(); ++k) {
            Complex change = 0.0;
            for (int i = 0; i < r; ++i) {
                change -= term.from_displacement[i] * offset(i, k) + term.from_velocity[i] * velocity(i, k);
            }
            for (std::size_t a = 0; a < modes.driven.size(); ++a) change += from_force[modes.driven[a]] * driving(a, k);
            term.from_force[modes.free[k]] += change;
        }
    }
    for (std::size_t k = 0; k < modes.free.size(); ++k) {
        MotionTerm constant(0.0, 0, r), start(0.0, 0, r), linear(0.0, 1, r);  // u, then w t with its derivative w
        constant.shape = offset.col(k).cast<Complex>();
        start.shape = linear.shape = drift.col(k).cast<Complex>();
        constant.from_force = linear.from_force = unit(r, modes.free[k]);
        motion.terms.insert(motion.terms.end(), {constant, start, linear});
    }
}

// The motion of the parts and of zero-frequency modes.
MotionTerms motion_of_parts(CoupledModes modes) {
    if (!modes.free.empty()) {
        const ComplexMatrix velocities = modes.velocities(modes.free, Eigen::all);
        modes.shapes(modes.free, Eigen::all) = integral(velocities, modes.parts);
    }
    if (!is_zero(modes.driving)) {
        const ComplexMatrix accelerations = modes.driving(modes.driven, Eigen::all);
        modes.shapes(modes.driven, Eigen::all) = integral(integral(accelerations, modes.parts), modes.parts);
    }
    MotionTerms motion(modes.modes);
    add_parts(motion, modes);
    add_initial_drift(motion, modes);
    if (!modes.free.empty()) add_drift(motion, modes);
    return motion;
}

// Weight of t^(n + integrals) in exp(lambda t) integrated once, twice or three times; twice: those of slow_powers.
Complex integrated(const std::vector<Complex>& twice, Complex rate, int n, int integrals) {
    if (integrals == 1) return n == 0 ? 1.0 : twice[n - 1] * rate;
    return integrals == 2 ? twice[n] : twice[n] / (n + 3.0);
}

// Adds the motion of slow parts in powers of time: V y, X q on free modes and R u on driven ones,
//
//     u' = q,   q' = y,   y' = lambda y + p
//
// u = y(0) t^2 / 2 + ..., q = y(0) t + ..., y = y(0) + ... and the other terms are a exp(lambda t) integrated three
// times, twice and once, a = lambda y(0) + p.
void add_slow_parts(MotionTerms& motion, const CoupledModes& modes, double duration) {
    const int r = modes.modes;
    for (int k = 0; k < modes.parts.size(); ++k) {
        const Complex rate = modes.parts.rates[k];
        const std::vector<Complex> weights = slow_powers(rate, duration);
        MotionTerm start(0.0, 0, r), acceleration(0.0, 0, r);  // y(0) and a
        start.from_displacement = modes.from_displacement.row(k).transpose();
        start.from_velocity = modes.from_velocity.row(k).transpose();
        acceleration.from_displacement = rate * start.from_displacement;
        acceleration.from_velocity = rate * start.from_velocity;
        const int length = is_zero(modes.driving.col(k)) ? 2 : 3;  // of the chain u, q, y
        Chain chain{ComplexMatrix::Zero(length, length), ComplexMatrix::Zero(length, r),
                    ComplexMatrix::Zero(length, r)};
        chain.mixing.diagonal(1).setOnes();
        chain.mixing(length - 1, length - 1) = rate;
        if (length == 3) chain.shapes.row(0) = modes.driving.col(k).transpose();
        for (const int mode : modes.free) {
            acceleration.from_force[mode] = modes.from_velocity(k, mode);
            chain.shapes(length - 2, mode) = modes.velocities(mode, k);
        }
        chain.shapes.row(length - 1) = modes.shapes.col(k).transpose();
        chain.pushes.row(length - 1) = start.from_velocity.transpose();
        for (int integrals = length; integrals >= 1; --integrals) {  // u, q, then y
            const int count = std::max(integrals, 2) + static_cast<int>(weights.size());
            for (int d = 0; d < count; ++d) {
                const int n = d - integrals;  // power of exp(lambda t); -1: the term of y(0)
                MotionTerm term = n < 0 ? start : acceleration;
                const Complex at_start = n < -1 ? 0.0 : (integrals == 3 ? 0.5 : 1.0);
                const Complex weight = n < 0 ? at_start : integrated(weights, rate, n, integrals);
                term.from_displacement *= weight;
                term.from_velocity *= weight;
                term.from_force *= weight;
                term.power = d;
                term.shape = chain.shapes.row(length - integrals).transpose();
                motion.terms.push_back(term);
            }
        }
        motion.chains.push_back(chain);
    }
}

}  // namespace

MotionTerms coupled_motion(const Vector& squares, const Matrix& stiffness, const Matrix& damping, double duration) {
    if (!(stiffness.allFinite() && damping.allFinite())) throw NumericalFailure(Cause::level_not_finite);
    const CoupledModes modes = coupled_modes(squares, stiffness, damping);
    const std::vector<char> slow = slow_components(modes, duration);
    std::vector<char> fast;
    bool has_slow = false;
    for (const char is_slow_component : slow) {
        has_slow = has_slow || is_slow_component;
        fast.push_back(!is_slow_component);
    }
    if (!has_slow) return motion_of_parts(modes);
    MotionTerms motion = motion_of_parts(only(modes, fast));
    add_slow_parts(motion, only(modes, slow), duration);
    return motion;
}

}  // namespace multiphi
