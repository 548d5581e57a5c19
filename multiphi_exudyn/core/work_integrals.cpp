#include "work_integrals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "particular_solutions.hpp"

namespace multiphi {

namespace {

constexpr double largest_factor = 1024.0;   // times a segment's horizon, for a tenth of the terms
constexpr double upwards_above = 0.5;       // |s t| - d above which I_d follows from I_d-1: below, d! / |s t|^d is lost
constexpr double series_round_off = 1e-18;  // of the first term of a power series: terms below it are left out

// |eta'|^2 + |omega eta|^2
double motion_square(const State& state) {
    double total = 0.0;
    for (int i = 0; i < state.level->modes(); ++i) {
        const double velocity = state.velocity[i], elastic = state.level->omega()[i] * state.displacement[i];
        total += velocity * velocity + elastic * elastic;
    }
    return total;
}

// The same of the free response alone: the sum of |V c lambda|^2.
double free_motion_square(const Motion& motion) {
    const ModalResponse& response = motion.level().response();
    double total = 0.0;
    for (int j = 0; j < motion.free_size(); ++j) {
        const Complex rate = motion.coefficients()[j] * motion.basis().rates[j];
        for (int i = 0; i < response.modes; ++i) total += std::norm(product(rate, response.shapes(j, i)));
    }
    return total;
}

// Power of two by which the horizon is to be longer for all poles to be far from the rates of the channels' terms. The
// response then has no more powers of time than the terms; the price is as many digits of what the terms add to the
// motion in its first horizon. The factor is 1 where the largest one is too small for that.
double horizon_factor(const Level& level, const Inputs& inputs) {
    double nearest = std::numeric_limits<double>::infinity(), factor = 1.0;
    int degree = 0;
    for (const Term& term : inputs.terms()) {
        degree = std::max(degree, static_cast<int>(term.coefficients.rows()) - 1);
        for (const Complex& pole : level.response().basis.rates)
            nearest = std::min(nearest, std::hypot(pole.real() - term.rate.real(),
                                                   std::abs(pole.imag()) - std::abs(term.rate.imag())));
    }
    const double limit = std::pow(largest_factor, 1.0 / std::max(degree, 1));
    while (!is_far(nearest, degree + 1, inputs.horizon() * factor) && factor < limit) factor *= 2.0;
    return is_far(nearest, degree + 1, inputs.horizon() * factor) ? factor : 1.0;
}

}  // namespace

Works WorkIntegrals::integrate(const State& start, Inputs& inputs, double duration, double entry_work) {
    const Level& level = *start.level;
    const WorkForms& forms = level.work_forms();
    Works works;
    works.varying = inputs.count() > 0 ? entry_work : 0.0;
    if (level.potential().follows.rows() > 0) {
        motion_.begin(start, inputs);
        end_.enter(level);
        motion_.state_at(duration, end_.displacement, end_.velocity);
        works.friction = spring_energy(start) - spring_energy(end_);
    }
    begin(start, inputs);
    phi_.resize(motion_.size());
    motion_.basis().evaluate(duration, phi_.data());
    closed_count_ = 0;
    if (forms.damping) {
        closed_count_ = motion_.free_size();
        works.damping += free_damping_work(forms, duration);
    }
    if (closed_count_ == motion_.size() && level.channels() == 0) return works;
    const bool has_friction = forms.powers.friction.size() > 0;
    list_terms(has_friction ? 0 : closed_count_);
    list_factors(forms);
    add_constants(forms.powers, works);
    if (has_friction) add_friction(forms.powers, works);
    add_products(forms, duration, works);
    return works;
}

// Begins the motion, with a longer horizon where that gives fewer terms and no large free response.
void WorkIntegrals::begin(const State& start, Inputs& inputs) {
    const double horizon = inputs.horizon(), factor = inputs.count() > 0 ? horizon_factor(*start.level, inputs) : 1.0;
    if (factor > 1.0) {
        inputs.set_horizon(horizon * factor);
        motion_.begin(start, inputs);
        inputs.set_horizon(horizon);
        largest_square_ = std::max(largest_square_, motion_square(start));
        if (!(free_motion_square(motion_) > large_free_response * largest_square_)) return;
    }
    motion_.begin(start, inputs);
}

// Energy [J] of springs whose stretch follows the force of a link.
double WorkIntegrals::spring_energy(const State& state) const {
    const Matrix& follows = state.level->potential().follows;
    const Index n = state.displacement.size();
    return 0.5 * (follows.leftCols(n) * state.displacement + follows.col(n)).squaredNorm();
}

// Work of damping [J] on the free response alone. The change of the form is summed from exp(lambda t) - 1: in short
// segments the difference of two states would be round-off.
double WorkIntegrals::free_damping_work(const WorkForms& forms, double duration) {
    const ModalResponse& response = motion_.level().response();
    const int r = response.modes;
    sum_.assign(2 * r, 0.0);
    change_.assign(2 * r, 0.0);
    for (int j = 0; j < motion_.free_size(); ++j) {
        const Complex rate = motion_.basis().rates[j], c = motion_.coefficients()[j];
        const double half = std::sin(0.5 * rate.imag() * duration), growth = std::expm1(rate.real() * duration);
        const double sine = std::sin(rate.imag() * duration) * (1.0 + growth);
        const Complex change = product(c, Complex(growth * (1.0 - 2.0 * half * half) - 2.0 * half * half, sine));
        const Complex total = 2.0 * c + change;
        for (int i = 0; i < r; ++i) {
            const Complex displacement = response.shapes(j, i), velocity = product(displacement, rate);
            sum_[i] += real_product(displacement, total);
            sum_[r + i] += real_product(velocity, total);
            change_[i] += real_product(displacement, change);
            change_[r + i] += real_product(velocity, change);
        }
    }
    return damping_work(forms, sum_.data(), change_.data());
}

// Coefficients of xi, xi', xi'' of the motion, from its `first` exponential on.
void WorkIntegrals::list_terms(int first) {
    const Level& level = motion_.level();
    const Exponentials& basis = motion_.basis();
    const int n = level.width(), p = motion_.size(), free = motion_.free_size();
    for (ComplexMatrix* part : {&displacement_, &velocity_, &acceleration_}) part->setZero(p, n);
    for (int j = first; j < p; ++j) {
        const ComplexMatrix& shapes = j < free ? level.response().shapes : motion_.forced_shapes();
        const int row = j < free ? j : j - free, size = j < free ? level.modes() : level.modes() + level.prescribed();
        for (int i = 0; i < size; ++i) displacement_(j, i) = product(shapes(row, i), motion_.coefficients()[j]);
    }
    const auto differentiate = [&](const ComplexMatrix& coefficients, ComplexMatrix& result) {
        for (int j = first; j < p; ++j) {
            const int power = j + 1 < p ? basis.powers[j + 1] : 0;
            for (int i = 0; i < n; ++i) {
                result(j, i) = product(basis.rates[j], coefficients(j, i));
                if (power > 0) result(j, i) += power / basis.unit * coefficients(j + 1, i);
            }
        }
    };
    differentiate(displacement_, velocity_);
    if (level.channels() > 0) differentiate(velocity_, acceleration_);
}

// Coefficients of D xi', of what works on w_k and w_k' without e_k, and of T_e and s_e.xi'. Of the first exponentials,
// whose products need no integral, the level keeps them.
void WorkIntegrals::list_factors(const WorkForms& forms) {
    const Level& level = motion_.level();
    const PowerForms& powers = forms.powers;
    const int n = level.width(), r = level.modes(), q = level.channels(), p = motion_.size();
    const int pairs = static_cast<int>(powers.link_friction.size());
    damped_.setZero(p, n);
    for (ComplexMatrix* part : {&on_value_, &on_rate_}) part->setZero(p, q);
    for (ComplexMatrix* part : {&limits_, &slips_}) part->setZero(p, pairs);
    for (int j = 0; j < (q > 0 ? closed_count_ : 0); ++j) {
        const Complex c = motion_.coefficients()[j];
        for (int k = 0; k < q; ++k) {
            on_value_(j, k) = product(c, forms.exponentials(j, r + k));
            on_rate_(j, k) = product(c, forms.exponentials(j, r + q + k));
        }
    }
    for (int j = closed_count_; j < p; ++j) {
        for (int i = 0; i < n; ++i) {
            Complex total = 0.0;
            for (int k = 0; k < n; ++k) total += powers.damping(i, k) * velocity_(j, k);
            damped_(j, i) = total;
        }
        for (int k = 0; k < q; ++k) {
            Complex on_value = 0.0, on_rate = 0.0;
            for (int i = 0; i < n; ++i) {
                on_value += powers.on_value(k, i) * velocity_(j, i);
                on_rate += powers.on_displacement(k, i) * displacement_(j, i) +
                           powers.on_velocity(k, i) * velocity_(j, i) +
                           powers.on_acceleration(k, i) * acceleration_(j, i);
            }
            on_value_(j, k) = on_value;
            on_rate_(j, k) = on_rate;
        }
        for (int e = 0; e < pairs; ++e) {
            const LinkFriction& friction = powers.link_friction[e];
            Complex limit = 0.0, slip = 0.0;
            for (int i = 0; i < n; ++i) {
                limit += friction.displacement[i] * displacement_(j, i) + friction.velocity[i] * velocity_(j, i);
                slip += friction.slip_velocity[i] * velocity_(j, i);
            }
            limits_(j, e) = limit;
            slips_(j, e) = slip;
        }
    }
}

Complex WorkIntegrals::change_of(int j) const { return phi_[j] - (motion_.basis().powers[j] == 0 ? 1.0 : 0.0); }

// Adds (e_k + b_k times the held displacements) times the change of w_k to the work of varying loads.
void WorkIntegrals::add_constants(const PowerForms& powers, Works& works) const {
    const Level& level = motion_.level();
    const int r = level.modes(), q = level.prescribed();
    for (int k = 0; k < q; ++k) {
        double constant = powers.constant[k];
        for (int held = r + q; held < level.width(); ++held)
            constant += powers.on_displacement(k, held) * motion_.start().displacement[held];
        for (int j = motion_.free_size(); j < motion_.size(); ++j)
            works.varying += constant * real_product(displacement_(j, r + k), change_of(j));
    }
}

// Adds the constant friction forces times slip to the work of friction: f and the constant part of T_e.
void WorkIntegrals::add_friction(const PowerForms& powers, Works& works) const {
    const Level& level = motion_.level();
    const int n = level.width(), first_held = level.modes() + level.prescribed();
    for (int j = 0; j < motion_.size(); ++j) {
        Complex work = 0.0;
        for (int i = 0; i < n; ++i) work += powers.friction[i] * displacement_(j, i);
        for (const LinkFriction& friction : powers.link_friction) {
            double constant = friction.constant;
            for (int held = first_held; held < n; ++held)
                constant += friction.displacement[held] * motion_.start().displacement[held];
            Complex slip = 0.0;
            for (int i = 0; i < n; ++i) slip += friction.slip[i] * displacement_(j, i);
            work += constant * slip;
        }
        works.friction += real_product(work, change_of(j));
    }
}

int WorkIntegrals::chain_length(int first) const {
    int end = first + 1;
    while (end < motion_.size() && motion_.basis().powers[end] > 0) ++end;
    return end - first;
}

// Adds the integrals of the products of all pairs of chains.
void WorkIntegrals::add_products(const WorkForms& forms, double duration, Works& works) {
    const Exponentials& basis = motion_.basis();
    const int p = motion_.size();
    powers_of_end_.assign(2 * p, 1.0);
    for (int d = 1; d < 2 * p; ++d) powers_of_end_[d] = powers_of_end_[d - 1] * (duration / basis.unit);
    for (int a = 0, length = 0; a < p; a += length) {
        length = chain_length(a);
        for (int b = std::max(a, closed_count_), further = 0; b < p; b += further) {
            further = chain_length(b);
            const int count = length + further - 1;
            if (!multiply(forms, a, length, b, further)) continue;
            add_integrals(plain_, basis.rates[a] + basis.rates[b], product(phi_[a], phi_[b]), count, duration, works);
            if (basis.rates[b].imag() == 0.0) continue;
            add_integrals(mirrored_, basis.rates[a] + std::conj(basis.rates[b]), product(phi_[a], std::conj(phi_[b])),
                          count, duration, works);
        }
    }
}

// Sums F_j G_k and F_j conj(G_k) over two chains, in both orders, by degree; where the second rate is real both have
// the same integral, and the first ones hold their sum. Returns whether any is not zero.
bool WorkIntegrals::multiply(const WorkForms& forms, int a, int length, int b, int further) {
    const Level& level = motion_.level();
    const int r = level.modes(), n = level.width(), q = level.channels(), free = motion_.free_size();
    const bool is_real = motion_.basis().rates[b].imag() == 0.0;
    bool is_any = false;
    plain_.assign(length + further - 1, {});
    mirrored_.assign(length + further - 1, {});
    for (int j = a; j < a + length; ++j) {
        const Range modes = j < free ? level.response().reached[j] : Range{0, n};
        const Complex* speeds = j < closed_count_ && q > 0 ? forms.exponentials.data() + j * forms.exponentials.cols()
                                                           : velocity_.data() + static_cast<Index>(j) * n;
        for (int k = a == b ? j : b; k < b + further; ++k) {
            const bool is_mixed = j != k;  // both orders count
            Products plain, mirrored;
            for (int i = modes.first; i < modes.end; ++i) {
                plain.damping += product(speeds[i], damped_(k, i));
                mirrored.damping += product(speeds[i], std::conj(damped_(k, i)));
            }
            if (j < closed_count_) {
                plain.damping = product(motion_.coefficients()[j], plain.damping);
                mirrored.damping = product(motion_.coefficients()[j], mirrored.damping);
            }
            if (is_mixed) {  // D is symmetric
                plain.damping *= 2.0;
                mirrored.damping *= 2.0;
            }
            const auto add_varying = [&](const ComplexMatrix& channels, const ComplexMatrix& factors) {
                for (int i = 0; i < q; ++i) {
                    if (j >= free) {
                        const Complex f = channels(j, r + i), g = factors(k, i);
                        plain.varying += product(f, g);
                        mirrored.varying += product(f, std::conj(g));
                    }
                    if (is_mixed) {
                        const Complex f = channels(k, r + i), g = factors(j, i);
                        plain.varying += product(f, g);
                        mirrored.varying += product(std::conj(f), g);
                    }
                }
            };
            add_varying(displacement_, on_value_);
            add_varying(velocity_, on_rate_);
            for (Index e = 0; e < limits_.cols(); ++e) {
                plain.friction += product(limits_(j, e), slips_(k, e));
                mirrored.friction += product(limits_(j, e), std::conj(slips_(k, e)));
                if (!is_mixed) continue;
                plain.friction += product(limits_(k, e), slips_(j, e));
                mirrored.friction += product(std::conj(limits_(k, e)), slips_(j, e));
            }
            if (is_real) {
                plain.damping += mirrored.damping;
                plain.varying += mirrored.varying;
                plain.friction += mirrored.friction;
            }
            for (const Complex& part : {plain.damping, plain.varying, plain.friction, mirrored.damping,
                                        mirrored.varying, mirrored.friction})
                is_any = is_any || part != 0.0;
            Products &plain_sum = plain_[j - a + k - b], &mirrored_sum = mirrored_[j - a + k - b];
            plain_sum.damping += plain.damping;
            plain_sum.varying += plain.varying;
            plain_sum.friction += plain.friction;
            mirrored_sum.damping += mirrored.damping;
            mirrored_sum.varying += mirrored.varying;
            mirrored_sum.friction += mirrored.friction;
        }
    }
    return is_any;
}

// Adds the integrals I_d of (t / T)^d exp(s t) times their factors to the works; `end`: exp(s t) at the end.
//
//     I_d = (u^d exp(s t) - d / T I_d-1) / s, u = t / T, upwards while d is below |s t|; the others downwards from
//     I_d = t u^d exp(s t) sum_n (-s t)^n / ((d + 1) (d + 2) ... (d + n + 1))
void WorkIntegrals::add_integrals(const std::vector<Products>& products, Complex rate, Complex end, int count,
                                  double duration, Works& works) const {
    const double unit = motion_.basis().unit, size = std::sqrt(std::norm(rate));
    const auto add = [&](int d, const Complex& integral) {
        works.damping += 0.5 * real_product(products[d].damping, integral);
        works.varying += 0.5 * real_product(products[d].varying, integral);
        works.friction += 0.5 * real_product(products[d].friction, integral);
    };
    const double most_upwards = std::floor(size * duration - upwards_above) + 1;
    const int upwards = most_upwards > 0.0 ? static_cast<int>(std::min(most_upwards, static_cast<double>(count))) : 0;
    const Complex inverse = upwards > 0 ? Complex(rate.real() / size / size, -rate.imag() / size / size) : Complex(0.0);
    Complex integral = end - 1.0;
    for (int d = 0; d < upwards; ++d) {
        if (d > 0) integral = powers_of_end_[d] * end - d / unit * integral;
        integral = product(integral, inverse);
        add(d, integral);
    }
    if (upwards == count) return;
    Complex term = duration / count * powers_of_end_[count - 1] * end;
    const Complex x = rate * duration;
    const double least = series_round_off * (std::abs(term.real()) + std::abs(term.imag()));
    integral = 0.0;
    for (int n = count + 1; std::abs(term.real()) + std::abs(term.imag()) > least; ++n) {
        integral += term;
        term = product(term, x * (-1.0 / n));
    }
    for (int d = count - 1; d >= upwards; --d) {
        add(d, integral);
        if (d > 0) integral = (powers_of_end_[d] * end - product(rate, integral)) * (unit / d);
    }
}

}  // namespace multiphi
