#include "work_forms.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "decompositions.hpp"
#include "level.hpp"

namespace multiphi {

namespace {

constexpr double largest_primitive = 1e3;   // times the squared velocities: energies are of the size of these
constexpr int most_coefficients = 16;       // N: with more, integrals over products of exponentials are faster
constexpr double nearly_cancelled = 1e-6;   // of two rates: their sum, unless it is zero; primitives would be large

double square(const Complex& z) { return z.real() * z.real() + z.imag() * z.imag(); }

// ---------------------------------------------------------------------- free response

// Replaces the power [Re S, Im S]^T D [Re S, Im S] (2 p, 2 p) by its primitive in (Re z, Im z); false if that is much
// larger than the velocities, of which `sizes` (p,) are the squares.
bool integrate_power(const std::vector<Complex>& rates, const Vector& sizes, Matrix& power) {
    const int p = static_cast<int>(rates.size());
    for (int j = 0; j < p; ++j) {
        for (int k = 0; k < p; ++k) {
            double &one = power(j, k), &crossed = power(j, p + k);
            double &back = power(p + j, k), &other = power(p + j, p + k);
            Complex a(one - other, crossed + back), b(one + other, back - crossed);
            const Complex sum = rates[j] + rates[k], difference = rates[j] + std::conj(rates[k]);
            const double largest = largest_primitive * largest_primitive * sizes[j] * sizes[k];
            const double first = square(sum), second = square(difference);
            if (square(a) > largest * first || square(b) > largest * second) return false;
            a = first > 0.0 ? product(a, std::conj(sum) * (0.5 / first)) : Complex(0.0);
            b = second > 0.0 ? product(b, std::conj(difference) * (0.5 / second)) : Complex(0.0);
            one = b.real() + a.real();
            crossed = b.imag() - a.imag();
            back = -b.imag() - a.imag();
            other = b.real() - a.real();
        }
    }
    return true;
}

// F of the work of damping D in the free response z = c exp(lambda t) (p,): with the velocities S = V Lambda,
//
//     eta'.D eta' = 1/2 Re (z.S^T D S z + z.S^T D conj(S z)) = d/dt 1/2 Re (z.A z + z.B conj(z))
//
// and A, B are S^T D S and S^T D conj(S) over the sums lambda_j + lambda_k and lambda_j + conj(lambda_k). In an
// undamped motion B is one round-off divided by another. The asymmetric part of F consists of that alone, and is
// removed, as y.F y changes by (y_1 + y_0).F (y_1 - y_0) only for a symmetric F.
std::optional<Matrix> free_damping(const ModalResponse& response, const Matrix& damping) {
    const int r = response.modes, p = response.basis.size();
    Matrix velocities(2 * p, r), starts(2 * p, 2 * r);
    Vector sizes = Vector::Zero(p);
    for (int j = 0; j < p; ++j) {
        for (int i = 0; i < r; ++i) {
            const Complex velocity = product(response.shapes(j, i), response.basis.rates[j]);
            const Complex &displaced = response.from_displacement(j, i), &moving = response.from_velocity(j, i);
            sizes[j] += square(velocity);
            velocities(j, i) = velocity.real();
            velocities(p + j, i) = velocity.imag();
            starts(j, i) = displaced.real();
            starts(p + j, i) = displaced.imag();
            starts(j, r + i) = moving.real();
            starts(p + j, r + i) = moving.imag();
        }
    }
    Matrix power = velocities * damping.topLeftCorner(r, r) * velocities.transpose();
    if (!integrate_power(response.basis.rates, sizes, power)) return std::nullopt;
    const Matrix form = starts.transpose() * power * starts;
    return (form + form.transpose()) / 2;
}

// The modes that each mode is coupled to in a form (2 r, 2 r).
std::vector<Range> coupled_modes(const Matrix& form) {
    const int r = static_cast<int>(form.rows()) / 2;
    std::vector<Range> result;
    for (int i = 0; i < r; ++i) {
        Range range{r, 0};
        for (int k = 0; k < r; ++k) {
            const double parts[] = {form(i, k), form(i, r + k), form(r + i, k), form(r + i, r + k)};
            if (std::all_of(std::begin(parts), std::end(parts), [](double part) { return part == 0.0; })) continue;
            range.first = std::min(range.first, k);
            range.end = k + 1;
        }
        result.push_back(range);
    }
    return result;
}

// Velocities eta' of the exponentials of the free response, and the forces that work on w and on w' (p, r + 2 q).
ComplexMatrix exponential_powers(const Level& level, const PowerForms& powers) {
    const ModalResponse& response = level.response();
    const int r = level.modes(), q = level.channels(), p = response.basis.size();
    const ComplexVector rates = ComplexVector::Map(response.basis.rates.data(), p);
    const ComplexMatrix shapes = response.shapes.transpose(), velocities = shapes * rates.asDiagonal();
    const ComplexMatrix accelerations = velocities * rates.asDiagonal();
    ComplexMatrix result(p, r + 2 * q);
    result.leftCols(r) = velocities.transpose();
    result.middleCols(r, q) = (powers.on_value.leftCols(r) * velocities).transpose();
    result.rightCols(q) = (powers.on_displacement.leftCols(r) * shapes + powers.on_velocity.leftCols(r) * velocities +
                           powers.on_acceleration.leftCols(r) * accelerations).transpose();
    return result;
}

// ---------------------------------------------------------------------- response to carriers

// rate^2 + D rate + S.
ComplexMatrix dynamic_stiffness(const Complex& rate, const Matrix& stiffness, const Matrix& damping) {
    ComplexMatrix result = stiffness + rate * damping;
    result.diagonal().array() += rate * rate;
    return result;
}

// A form in (Re a, Im a) and the part of a power that has none.
struct Squared {
    Matrix changing, lasting;
};

// The form of Re(a.P a + a.P~ conj(a)) / 2 in (Re a, Im a).
Matrix real_form(const ComplexMatrix& power, const ComplexMatrix& conjugated) {
    const Index n = power.rows();
    Matrix result(2 * n, 2 * n);
    result << power.real() + conjugated.real(), conjugated.imag() - power.imag(), -power.imag() - conjugated.imag(),
        conjugated.real() - power.real();
    return 0.5 * result;
}

// Coefficients a (N,) of carriers with their powers of time, of q channels: carrier by carrier, power by power.
class Chains {
  public:
    Chains(const std::vector<Carrier>& carriers, int channels) : carriers_(carriers), q_(channels) {
        for (const Carrier& carrier : carriers)
            for (int d = 0; d < carrier.powers; ++d) terms_.push_back({carrier.rate, static_cast<double>(d)});
        motion_.setZero(size(), size());
        values_.setZero(q_, size());
        for (int k = 0; k < count(); ++k) {
            for (int i = 0; i < q_; ++i) {
                motion_(k * q_ + i, k * q_ + i) = terms_[k].rate;
                if (terms_[k].power > 0) motion_((k - 1) * q_ + i, k * q_ + i) = terms_[k].power;
                if (terms_[k].power == 0) values_(i, k * q_ + i) = 1.0;
            }
        }
    }

    int size() const { return q_ * count(); }               // N
    const ComplexMatrix& motion() const { return motion_; }  // M
    const ComplexMatrix& values() const { return values_; }  // w = Re values a

    // Indices of those of (Re a, Im a) that are in b, in their order there.
    std::vector<int> kept() const {
        std::vector<int> result;
        int first = 0;
        for (const Carrier& carrier : carriers_) {
            const int end = first + carrier.powers * q_;
            for (int k = first; k < end; ++k) result.push_back(k);
            if (carrier.rate.imag() != 0.0)
                for (int k = first; k < end; ++k) result.push_back(size() + k);
            first = end;
        }
        return result;
    }

    // The upper half (r, N) of G: eta'' + D eta' + S eta = P w + Q w'.
    ComplexMatrix response(const LevelData& level, const Matrix& stiffness) const {
        const Index r = stiffness.rows();
        const ComplexMatrix pushes = level.channel_force.leftCols(q_) * values_ +
                                     level.channel_force_rate.leftCols(q_) * (values_ * motion_);
        ComplexMatrix result = ComplexMatrix::Zero(r, size());
        for (int k = 0; k < count(); ++k) {
            const Complex rate = terms_[k].rate;
            const double d = terms_[k].power;
            ComplexMatrix force = pushes.middleCols(k * q_, q_);
            if (d > 0) {
                const ComplexMatrix before = result.middleCols((k - 1) * q_, q_);
                force -= d * (2.0 * rate * before + level.damping_matrix * before);
            }
            if (d > 1) force -= d * (d - 1) * result.middleCols((k - 2) * q_, q_);
            result.middleCols(k * q_, q_) = solve(dynamic_stiffness(rate, stiffness, level.damping_matrix), force);
        }
        return result;
    }

    // R (N, 2 r) of W = (on_displacement, on_velocity).
    ComplexMatrix crossed(const ComplexMatrix& on_displacement, const ComplexMatrix& on_velocity,
                          const Matrix& stiffness, const Matrix& damping) const {
        const Index r = stiffness.rows();
        ComplexMatrix result = ComplexMatrix::Zero(size(), 2 * r);
        for (int k = 0; k < count(); ++k) {
            const Complex rate = terms_[k].rate;
            const double d = terms_[k].power;
            ComplexMatrix displaced = on_displacement.middleRows(k * q_, q_);
            ComplexMatrix moving = on_velocity.middleRows(k * q_, q_);
            if (d > 0) {
                const ComplexMatrix before = d * result.middleRows((k - 1) * q_, q_);
                displaced -= before.leftCols(r);
                moving -= before.rightCols(r);
            }
            const ComplexMatrix system = dynamic_stiffness(-rate, stiffness, damping).transpose();
            const ComplexMatrix turned = solve(system, (rate * moving - displaced).transpose()).transpose();
            result.block(k * q_, r, q_, r) = turned;
            result.block(k * q_, 0, q_, r) = moving - rate * turned + turned * damping;
        }
        return result;
    }

    // The primitive of Re(one a).Re(other a), none where rates nearly cancel.
    std::optional<Squared> squared(const ComplexMatrix& one, const ComplexMatrix& other) const {
        const std::optional<Primitive> plain = primitive(one.transpose() * other, false);
        const std::optional<Primitive> mirrored = primitive(one.transpose() * other.conjugate(), true);
        if (!plain || !mirrored) return std::nullopt;
        return Squared{real_form(plain->changing, mirrored->changing), real_form(plain->lasting, mirrored->lasting)};
    }

  private:
    struct ChainTerm {
        Complex rate;
        double power;
    };
    struct Primitive {
        ComplexMatrix changing, lasting;
    };

    int count() const { return static_cast<int>(terms_.size()); }

    // P (N, N) of Q, conjugated: the rates of its second index, and the part of Q that has no primitive.
    std::optional<Primitive> primitive(const ComplexMatrix& power, bool is_conjugated) const {
        Primitive result{ComplexMatrix::Zero(size(), size()), ComplexMatrix::Zero(size(), size())};
        for (int k = 0; k < count(); ++k) {
            for (int j = 0; j < count(); ++j) {
                const Complex rate = terms_[k].rate, other = terms_[j].rate;
                const Complex total = rate + (is_conjugated ? std::conj(other) : other);
                const int row = k * q_, column = j * q_;
                ComplexMatrix form = power.block(row, column, q_, q_);
                if (total == 0.0) {
                    result.lasting.block(row, column, q_, q_) = form;
                    continue;
                }
                if (std::abs(total) < nearly_cancelled * (std::abs(rate) + std::abs(other))) return std::nullopt;
                if (terms_[k].power > 0) form -= terms_[k].power * result.changing.block(row - q_, column, q_, q_);
                if (terms_[j].power > 0) form -= terms_[j].power * result.changing.block(row, column - q_, q_, q_);
                result.changing.block(row, column, q_, q_) = form / total;
            }
        }
        return result;
    }

    const std::vector<Carrier>& carriers_;
    int q_;
    std::vector<ChainTerm> terms_;
    ComplexMatrix motion_, values_;
};

// Nodes and weights of Gauss-Legendre quadrature on [0, 1], by Newton's method on the Legendre polynomial.
void gauss_legendre(int count, std::vector<double>& nodes, std::vector<double>& weights) {
    constexpr int iterations = 8;  // from starting values that are off by less than 1 / count^2
    nodes.resize(count);
    weights.resize(count);
    for (int k = 0; k < count; ++k) {
        double x = std::cos(std::numbers::pi * (count - k - 0.25) / (count + 0.5)), slope = 1.0;
        for (int step = 0; step < iterations; ++step) {
            double value = 1.0, next = x;  // P_0, P_1
            for (int d = 1; d < count; ++d)
                value = std::exchange(next, ((2 * d + 1) * x * next - d * value) / (d + 1));
            slope = count * (value - x * next) / (1.0 - x * x);
            x -= next / slope;
        }
        nodes[k] = (x + 1.0) / 2.0;
        weights[k] = 1.0 / ((1.0 - x * x) * slope * slope);
    }
}

// Rows b of a primitive (k, k + 2 r): its form in b, and R of b and y.
Matrix rows_of(const Matrix& form, const ComplexMatrix& crossed, const std::vector<int>& kept) {
    const Index n = crossed.rows(), width = static_cast<Index>(kept.size());
    Matrix parts(2 * n, crossed.cols()), result(width, width + crossed.cols());
    parts << crossed.real(), -crossed.imag();
    result << form(kept, kept), parts(kept, Eigen::all);
    return result;
}

std::optional<DrivenForms> driven_forms(const Level& level, const PowerForms& powers) {
    const std::vector<Carrier>& carriers = level.excitation().intervals.carriers();
    const LevelData& data = level.data();
    const int q = level.prescribed(), r = level.modes(), n = level.width();
    int coefficients = 0, most_powers = 0;
    for (const Carrier& carrier : carriers) {
        coefficients += carrier.powers * q;
        most_powers = std::max(most_powers, carrier.powers);
    }
    if (coefficients == 0 || coefficients > most_coefficients) return std::nullopt;
    const Chains chains(carriers, q);
    const Matrix stiffness = data.coupling + Matrix(data.squares.asDiagonal()), &damping = data.damping_matrix;
    ComplexMatrix displacements = ComplexMatrix::Zero(n, chains.size());
    displacements.topRows(r) = chains.response(data, stiffness);
    displacements.middleRows(r, q) = chains.values();
    const ComplexMatrix velocities = displacements * chains.motion(), accelerations = velocities * chains.motion();
    const Matrix a = powers.on_value.topRows(q), b = powers.on_displacement.topRows(q),
                 c = powers.on_velocity.topRows(q), d = powers.on_acceleration.topRows(q);
    // w and w', and what works on them: of the carriers, and of the free response
    ComplexMatrix drives(2 * q, chains.size()), pushed(2 * q, chains.size());
    Matrix on_displacement(2 * q, r), on_velocity(2 * q, r);
    drives << chains.values(), chains.values() * chains.motion();
    pushed << a * velocities, b * displacements + c * velocities + d * accelerations;
    on_displacement << Matrix::Zero(q, r), b.leftCols(r) - d.leftCols(r) * stiffness;
    on_velocity << a.leftCols(r), c.leftCols(r) - d.leftCols(r) * damping;
    const std::optional<Squared> damped = chains.squared(velocities, powers.damping * velocities);
    const std::optional<Squared> varied = chains.squared(drives, pushed);
    if (!damped || !varied) return std::nullopt;
    const ComplexMatrix still = ComplexMatrix::Zero(chains.size(), r);
    const ComplexMatrix damped_crossed =
        chains.crossed(still, 2.0 * velocities.transpose() * powers.damping.leftCols(r), stiffness, damping);
    const ComplexMatrix varied_crossed = chains.crossed(drives.transpose() * on_displacement,
                                                        drives.transpose() * on_velocity, stiffness, damping);
    const std::vector<int> kept = chains.kept();
    Matrix response(2 * r, 2 * chains.size());
    response << displacements.topRows(r).real(), -displacements.topRows(r).imag(), velocities.topRows(r).real(),
        -velocities.topRows(r).imag();
    DrivenForms forms;
    forms.carriers = carriers;
    forms.response = response(Eigen::all, kept);
    forms.changing_damping = rows_of(damped->changing, damped_crossed, kept);
    forms.changing_varying = rows_of(varied->changing, varied_crossed, kept);
    forms.lasting_damping = damped->lasting(kept, kept);
    forms.lasting_varying = varied->lasting(kept, kept);
    for (const Matrix* part : {&forms.response, &forms.changing_damping, &forms.changing_varying,
                               &forms.lasting_damping, &forms.lasting_varying})
        if (!part->allFinite()) return std::nullopt;  // a carrier meets a pole
    gauss_legendre(most_powers, forms.nodes, forms.weights);
    return forms;
}

}  // namespace

std::size_t WorkForms::bytes() const {
    Index numbers = powers.damping.size() + powers.friction.size() + powers.constant.size();
    numbers += 4 * powers.on_value.size();
    for (const LinkFriction& friction : powers.link_friction) numbers += 4 * friction.slip.size();
    if (damping) numbers += damping->size();
    if (driven)
        numbers += driven->response.size() + 2 * (driven->changing_damping.size() + driven->lasting_damping.size());
    return sizeof(double) * static_cast<std::size_t>(numbers) +
           sizeof(Complex) * static_cast<std::size_t>(exponentials.size()) + sizeof(Range) * coupled.size();
}

WorkForms work_forms(const Level& level) {
    WorkForms forms;
    forms.powers = power_forms(level);
    if (!level.response().basis.pure || !forms.powers.link_friction.empty()) return forms;
    forms.damping = free_damping(level.response(), forms.powers.damping);
    if (!forms.damping) return forms;
    forms.coupled = coupled_modes(*forms.damping);
    if (level.channels() > 0) forms.exponentials = exponential_powers(level, forms.powers);
    if (level.prescribed() > 0) forms.driven = driven_forms(level, forms.powers);
    return forms;
}

}  // namespace multiphi
