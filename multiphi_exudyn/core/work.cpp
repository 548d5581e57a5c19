#include "work.hpp"

#include <algorithm>
#include <cmath>

#include "energy.hpp"

namespace multiphi {

Works& Works::operator+=(const Works& other) {
    damping += other.damping;
    varying += other.varying;
    friction += other.friction;
    return *this;
}

double damping_work(const WorkForms& forms, const double* sum, const double* change) {
    const Matrix& form = *forms.damping;
    const int r = static_cast<int>(forms.coupled.size());
    double total = 0.0;
    for (int i = 0; i < r; ++i) {  // four sums that do not wait for each other
        double first = 0.0, second = 0.0, third = 0.0, fourth = 0.0;
        const double *row = form.data() + static_cast<Index>(i) * 2 * r, *other = row + static_cast<Index>(r) * 2 * r;
        for (int k = forms.coupled[i].first; k < forms.coupled[i].end; ++k) {
            const double displacement = change[k], velocity = change[r + k];
            first += row[k] * displacement;
            second += row[r + k] * velocity;
            third += other[k] * displacement;
            fourth += other[r + k] * velocity;
        }
        total += sum[i] * (first + second) + sum[r + i] * (third + fourth);
    }
    return total;
}

namespace {

int coefficient_count(const DrivenForms& forms) { return static_cast<int>(forms.response.cols()); }

// Lists the coefficients b of the channels' terms; false where the forms lack one of their carriers.
bool list_coefficients(const DrivenForms& forms, const std::vector<Term>& terms, double* b) {
    std::fill(b, b + coefficient_count(forms), 0.0);
    for (const Term& term : terms) {
        const Index powers = term.coefficients.rows(), q = term.coefficients.cols();
        double* place = b;
        bool is_listed = false;
        for (const Carrier& carrier : forms.carriers) {
            const Index size = carrier.powers * q;
            const bool is_complex = carrier.rate.imag() != 0.0;
            if (carrier.rate == term.rate && carrier.powers >= powers) {
                is_listed = true;
                for (Index k = 0; k < powers * q; ++k) {
                    const Complex& coefficient = term.coefficients.data()[k];
                    place[k] = coefficient.real();
                    if (is_complex) place[size + k] = coefficient.imag();
                }
            }
            place += is_complex ? 2 * size : size;
        }
        if (!is_listed) return false;
    }
    return true;
}

// Puts y of a state behind the coefficients of u.
void add_free_state(const State& state, const DrivenForms* forms, int count, double* u) {
    const int r = state.level->modes();
    for (int part = 0; part < 2; ++part) {
        const Vector& source = part == 0 ? state.displacement : state.velocity;
        for (int i = 0; i < r; ++i) {
            double value = source[i];
            const double* row = count > 0 ? forms->response.data() + static_cast<Index>(part * r + i) * count : nullptr;
            for (int k = 0; k < count; ++k) value -= row[k] * u[k];
            u[count + part * r + i] = value;
        }
    }
}

// The change of b.B u, B (count, size), from the sum and the change of u.
double bilinear_change(const Matrix& rows, const double* sum, const double* change) {
    double total = 0.0;
    for (Index i = 0; i < rows.rows(); ++i) {
        const double* row = rows.data() + i * rows.cols();
        double of_change = 0.0, of_sum = 0.0;
        for (Index k = 0; k < rows.cols(); ++k) {
            of_change += row[k] * change[k];
            of_sum += row[k] * sum[k];
        }
        total += sum[i] * of_change + change[i] * of_sum;
    }
    return 0.5 * total;
}

// Sets b at a delay [s] later, without the phase of its carriers: synthetic division.
void shift_coefficients(const DrivenForms& forms, int q, double delay, const double* b, double* result) {
    std::copy(b, b + coefficient_count(forms), result);
    double* place = result;
    for (const Carrier& carrier : forms.carriers) {
        for (int part = 0; part < (carrier.rate.imag() != 0.0 ? 2 : 1); ++part) {
            for (int lowest = 0; lowest + 1 < carrier.powers; ++lowest)
                for (int d = carrier.powers - 2; d >= lowest; --d)
                    for (int k = 0; k < q; ++k) place[d * q + k] += delay * place[(d + 1) * q + k];
            place += carrier.powers * q;
        }
    }
}

// b.Z b
double quadratic_form(const Matrix& form, const double* b) {
    double total = 0.0;
    for (Index i = 0; i < form.rows(); ++i) {
        double row_sum = 0.0;
        for (Index k = 0; k < form.cols(); ++k) row_sum += form(i, k) * b[k];
        total += b[i] * row_sum;
    }
    return total;
}

}  // namespace

// Whether |eta'|^2 + |omega eta|^2 of y is much more than twice the largest energy so far.
bool WorkSums::is_free_response_large(const State& start, const double* free) {
    const Level& level = *start.level;
    const int r = level.modes();
    double total = 0.0, kinetic = 0.0;
    for (int i = 0; i < r; ++i) {
        const double elastic = level.omega()[i] * free[i];
        total += free[r + i] * free[r + i] + elastic * elastic;
        kinetic += start.velocity[i] * start.velocity[i];
    }
    largest_square_ = std::max(largest_square_, kinetic);
    if (total > large_free_response * largest_square_) {
        const double energy = potential_energy(start) + load_work(start);
        largest_square_ = std::max(largest_square_, kinetic + 2.0 * std::abs(energy));
    }
    return !(total <= large_free_response * largest_square_);
}

bool WorkSums::add_segment(const State& start, const State& end, const std::vector<Term>& terms_at_start,
                           const std::vector<Term>& terms_at_end, double duration, Works& works) {
    const Level& level = *start.level;
    const WorkForms& forms = level.work_forms();
    const PowerForms& powers = forms.powers;
    const int q = level.prescribed(), r = level.modes(), n = level.width();
    if (!forms.damping || (q > 0 && !forms.driven)) return false;
    const DrivenForms* driven = q > 0 ? &*forms.driven : nullptr;
    const int count = driven ? coefficient_count(*driven) : 0;
    for (Vector* part : {&first_, &last_, &sum_, &change_}) part->resize(count + 2 * r);
    if (driven && !list_coefficients(*driven, terms_at_start, first_.data())) return false;
    if (driven) list_coefficients(*driven, terms_at_end, last_.data());
    add_free_state(start, driven, count, first_.data());
    add_free_state(end, driven, count, last_.data());
    if (driven && is_free_response_large(start, first_.data() + count)) return false;
    sum_ = last_ + first_;
    change_ = last_ - first_;
    works.damping = damping_work(forms, sum_.data() + count, change_.data() + count);
    works.varying = works.friction = 0.0;
    if (driven) {
        works.damping += bilinear_change(driven->changing_damping, sum_.data(), change_.data());
        works.varying = bilinear_change(driven->changing_varying, sum_.data(), change_.data());
        mean_.resize(count);
        for (std::size_t node = 0; node < driven->nodes.size(); ++node) {
            const double weight = duration * driven->weights[node];
            shift_coefficients(*driven, q, duration * driven->nodes[node], first_.data(), mean_.data());
            works.damping += weight * quadratic_form(driven->lasting_damping, mean_.data());
            works.varying += weight * quadratic_form(driven->lasting_varying, mean_.data());
        }
    }
    for (int k = 0; k < q; ++k) {
        double constant = powers.constant[k];
        for (int held = r + q; held < n; ++held) constant += powers.on_displacement(k, held) * start.displacement[held];
        works.varying += constant * (end.displacement[r + k] - start.displacement[r + k]);
    }
    for (Index i = 0; i < powers.friction.size(); ++i)
        works.friction += powers.friction[i] * (end.displacement[i] - start.displacement[i]);
    return true;
}

}  // namespace multiphi
