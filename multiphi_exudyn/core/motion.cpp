#include "motion.hpp"

#include <algorithm>
#include <cmath>

namespace multiphi {

void Motion::begin(const State& state, const Inputs& inputs) {
    start_ = &state;
    const Level& level = *state.level;
    const ModalResponse& response = level.response();
    free_size_ = response.basis.size();
    basis_ = &response.basis;
    const double *displacement = state.displacement.data(), *velocity = state.velocity.data();
    if (level.prescribed() > 0) {
        respond_to(inputs);
        displacement = own_displacement_.data();
        velocity = own_velocity_.data();
    }
    coefficients_.resize(basis_->size(), Complex(1.0));
    const double* force = nullptr;
    if (level.drives_free_modes()) {
        drive_free_modes();
        force = free_force_.data();
    }
    response.coefficients(displacement, velocity, force, coefficients_.data());
    for (int j = 0; j < (response.basis.pure ? 0 : free_size_); ++j) coefficients_[j] *= unit_of(j);
    phi_.resize(basis_->size());
    rate_.resize(basis_->size());
}

// The force on zero-frequency modes: that of static loads, and of held channels at their values.
void Motion::drive_free_modes() {
    const Level& level = *start_->level;
    const int r = level.modes();
    free_force_.resize(r);
    for (int i = 0; i < r; ++i) {
        double total = level.constant_acceleration()[i];
        for (int k = r + level.prescribed(); k < level.width(); ++k)
            total += level.displacement_acceleration()(i, k) * start_->displacement[k];
        free_force_[i] = total;
    }
}

// The factor from a coefficient on the basis of the free response to that of this motion: their units of time differ.
double Motion::unit_of(int j) const {
    const Exponentials& free = start_->level->response().basis;
    const double ratio = basis_->unit / free.unit;
    double unit = 1.0;
    for (int d = 0; d < free.powers[j]; ++d) unit *= ratio;
    return unit;
}

// The response to the terms of the channels, with these terms, as x_k of the motion, and its basis; what is left of the
// start without it is the start of the free response.
void Motion::respond_to(const Inputs& inputs) {
    const Level& level = *start_->level;
    const ModalResponse& response = level.response();
    const int r = level.modes(), q = level.prescribed();
    const double horizon = inputs.horizon();
    own_displacement_ = start_->displacement.head(r);
    own_velocity_ = start_->velocity.head(r);
    all_exponentials_.powers.assign(response.basis.powers.begin(), response.basis.powers.end());
    all_exponentials_.rates.assign(response.basis.rates.begin(), response.basis.rates.end());
    forced_count_ = 0;
    int highest_power = 0;
    for (const Term& term : inputs.terms()) {
        const int degree = static_cast<int>(term.coefficients.rows()) - 1;
        // the term in powers of t / T, and its modal forces P w + Q w'
        scaled_term_ = term.coefficients;
        double scale = 1.0;
        for (int d = 0; d <= degree; ++d) {
            scaled_term_.row(d) *= scale;
            scale *= horizon;
        }
        modal_forces_.setZero(degree + 1, r);
        for (int d = 0; d <= degree; ++d)
            for (int k = 0; k < q; ++k) {
                const Complex value = scaled_term_(d, k);
                Complex slope = term.rate * value;
                if (d < degree) slope += (d + 1) / horizon * scaled_term_(d + 1, k);
                for (int i = 0; i < r; ++i)
                    modal_forces_(d, i) += level.displacement_acceleration()(i, r + k) * value +
                                           level.velocity_acceleration()(i, r + k) * slope;
            }
        const int rows = forced_response_.compute(response, term.rate, modal_forces_, degree, horizon,
                                                  start_->displacement.data(), start_->velocity.data());
        highest_power = std::max(highest_power, std::max(rows, degree + 1) - 1);
        add_forced(term, rows, horizon);
    }
    all_exponentials_.unit = highest_power > 0 ? horizon : response.basis.unit;
    all_exponentials_.describe();
    basis_ = &all_exponentials_;
    coefficients_.assign(all_exponentials_.size(), Complex(1.0));
}

// Appends the response (rows, r) to a term, and the term itself.
void Motion::add_forced(const Term& term, int rows, double horizon) {
    const int r = start_->level->modes(), q = start_->level->prescribed();
    const int degree = static_cast<int>(term.coefficients.rows()) - 1, count = std::max(rows, degree + 1);
    const ComplexMatrix& response = forced_response_.rows();
    if (forced_.rows() < forced_count_ + count || forced_.cols() != r + q)
        forced_.conservativeResize(std::max<Index>(forced_.rows(), forced_count_ + count), r + q);
    for (int k = 0; k < count; ++k) {
        const int row = forced_count_ + k;
        for (int i = 0; i < r; ++i) forced_(row, i) = k < rows ? response(k, i) : Complex(0.0);
        for (int i = 0; i < q; ++i) forced_(row, r + i) = k <= degree ? scaled_term_(k, i) : Complex(0.0);
        all_exponentials_.powers.push_back(k);
        all_exponentials_.rates.push_back(term.rate);
    }
    for (int i = 0; i < r; ++i) {
        const Complex value = forced_(forced_count_, i);
        Complex slope = term.rate * value;
        if (rows > 1) slope += 1.0 / horizon * response(1, i);
        own_displacement_[i] -= value.real();
        own_velocity_[i] -= slope.real();
    }
    forced_count_ += count;
}

void Motion::state_at(double t, Vector& displacement, Vector& velocity) {
    basis_->evaluate(t, phi_.data());
    basis_->differentiate(coefficients_.data(), rate_.data());
    sum(displacement, velocity);
}

void Motion::next_state(double step, bool same_step, Vector& displacement, Vector& velocity) {
    if (!same_step) {
        step_.resize(size());
        basis_->evaluate(step, step_.data());
    }
    for (int j = 0; j < size(); ++j) phi_[j] *= step_[j];
    sum(displacement, velocity);
}

// xi, xi' from the exponentials at a time and the coefficients of their derivatives; held channels keep their values.
void Motion::sum(Vector& displacement, Vector& velocity) const {
    const Level& level = *start_->level;
    const ModalResponse& response = level.response();
    const int r = level.modes(), moving = r + level.prescribed(), n = level.width();
    displacement.resize(n);
    velocity.setZero(n);
    for (int i = 0; i < n; ++i) displacement[i] = i < moving ? 0.0 : start_->displacement[i];
    for (int j = 0; j < free_size_; ++j) {
        const Complex value = coefficients_[j] * phi_[j], slope = rate_[j] * phi_[j];
        const Complex* shape = response.shapes.data() + static_cast<Index>(j) * r;
        for (int i = response.reached[j].first; i < response.reached[j].end; ++i) {
            displacement[i] += shape[i].real() * value.real() - shape[i].imag() * value.imag();
            velocity[i] += shape[i].real() * slope.real() - shape[i].imag() * slope.imag();
        }
    }
    for (int j = free_size_; j < size(); ++j) {  // every power of a carrier has a shape of its own
        const Complex value = coefficients_[j] * phi_[j];
        Complex slope = basis_->rates[j] * value;
        if (basis_->powers[j] > 0) slope += basis_->powers[j] / basis_->unit * phi_[j - 1];
        const Complex* shape = forced_.data() + (j - free_size_) * forced_.cols();
        for (int i = 0; i < moving; ++i) {
            displacement[i] += shape[i].real() * value.real() - shape[i].imag() * value.imag();
            velocity[i] += shape[i].real() * slope.real() - shape[i].imag() * slope.imag();
        }
    }
}

void Motion::raise_scales(State& state) const {
    // They say more than |eta'| / omega and omega |eta| where a mode has no frequency, and where a forced response
    // cancels a free one.
    const Level& level = *start_->level;
    const ModalResponse& response = level.response();
    const int r = level.modes();
    displacement_sizes_.setZero(r);
    velocity_sizes_.setZero(r);
    for (int j = 0; j < size(); ++j) {
        const double size = modulus(coefficients_[j]);
        const double value = size * modulus(phi_[j]);
        double slope = modulus(basis_->rates[j]) * value;
        if (basis_->powers[j] > 0) slope += basis_->powers[j] / basis_->unit * size * modulus(phi_[j - 1]);
        const bool is_free = j < free_size_;
        const Complex* shape = is_free ? response.shapes.data() + static_cast<Index>(j) * r
                                       : forced_.data() + (j - free_size_) * forced_.cols();
        for (int i = is_free ? response.reached[j].first : 0; i < (is_free ? response.reached[j].end : r); ++i) {
            const double shape_size = modulus(shape[i]);
            displacement_sizes_[i] += shape_size * value;
            velocity_sizes_[i] += shape_size * slope;
        }
    }
    for (int i = 0; i < r; ++i) {
        state.displacement_scale[i] = std::max(state.displacement_scale[i], displacement_sizes_[i]);
        state.velocity_scale[i] = std::max(state.velocity_scale[i], velocity_sizes_[i]);
    }
}

// ---------------------------------------------------------------------- signals on the motion

void Motion::signal(const Signal& signal, Complex* result) {
    const int moving = start_->level->modes() + start_->level->prescribed();
    const Row& row = signal.row;
    for (int j = 0; j < free_size_; ++j) {
        result[j] = signal.exponentials[j] * coefficients_[j];
        rate_[j] = row.depends_on_velocity ? signal.velocity_exponentials[j] * coefficients_[j] : Complex(0.0);
    }
    for (int j = free_size_; j < size(); ++j) {
        const Complex* shape = forced_.data() + (j - free_size_) * forced_.cols();
        Complex value = 0.0, slope = 0.0;
        for (int i = 0; i < moving; ++i) {
            value += row.displacement[i] * shape[i];
            slope += row.velocity[i] * shape[i];
        }
        result[j] = value;
        rate_[j] = slope;
    }
    if (!row.depends_on_velocity) return;
    basis_->differentiate(rate_.data(), rate_.data());
    for (int j = 0; j < size(); ++j) result[j] += rate_[j];
}

void Motion::signal_sizes(const Signal& signal, double* result) {
    // |row| |V| |c| + |row'| |V| |c| |lambda|, and of a power d > 0 its derivative d / T at the one before.
    const Level& level = *start_->level;
    const ModalResponse& response = level.response();
    const Row& row = signal.row;
    const int r = level.modes(), moving = r + level.prescribed();
    size_terms();
    for (int j = 0; j < size(); ++j) {
        const bool is_free = j < free_size_;
        const Complex* shape = is_free ? response.shapes.data() + static_cast<Index>(j) * r
                                       : forced_.data() + (j - free_size_) * forced_.cols();
        double value = 0.0, slope = 0.0;
        for (int i = is_free ? response.reached[j].first : 0; i < (is_free ? response.reached[j].end : moving); ++i) {
            const double size = modulus(shape[i]);
            value += std::abs(row.displacement[i]) * size;
            if (row.depends_on_velocity) slope += std::abs(row.velocity[i]) * size;
        }
        result[j] = value * term_sizes_[j];
        if (row.depends_on_velocity) {
            result[j] += slope * term_sizes_[j] * modulus(basis_->rates[j]);
            if (basis_->powers[j] > 0) result[j - 1] += basis_->powers[j] / basis_->unit * slope * term_sizes_[j];
        }
    }
}

// Sizes (p,) of the terms of the coefficients. The transition that has made the state counts: a stiff mode that hardly
// moves has the round-off of the modes from which it was mapped, and accelerates with it. So does the free response
// beside channels, where the forced response may exceed the motion.
void Motion::size_terms() {
    const State& state = *start_;
    const Level& level = *state.level;
    const ModalResponse& response = level.response();
    const int r = level.modes();
    term_sizes_.resize(size());
    for (int j = 0; j < size(); ++j) term_sizes_[j] = std::abs(coefficients_[j]);
    for (int j = 0; j < free_size_; ++j) {
        const int first = response.reached[j].first, end = response.reached[j].end;
        if (level.prescribed() > 0) {
            const double *displaced = level.response_sizes(0).data() + j * r, *moving = level.response_sizes(1).data() + j * r,
                         *forced = level.response_sizes(2).data() + j * r;
            double size = 0.0;
            for (int i = first; i < end; ++i) {
                const double x = own_displacement_[i], v = own_velocity_[i];
                size += displaced[i] * (std::abs(x) + std::abs(state.displacement[i] - x));
                size += moving[i] * (std::abs(v) + std::abs(state.velocity[i] - v));
                if (level.drives_free_modes()) size += forced[i] * std::abs(free_force_[i]);
            }
            term_sizes_[j] = size * unit_of(j);
        }
        double mapped = 0.0;
        const Complex *from_displacement = response.from_displacement.data() + static_cast<Index>(j) * r,
                      *from_velocity = response.from_velocity.data() + static_cast<Index>(j) * r;
        for (int i = first; i < end; ++i) {
            mapped += modulus(from_displacement[i]) * state.mapped_displacement[i];
            mapped += modulus(from_velocity[i]) * state.mapped_velocity[i];
        }
        term_sizes_[j] += mapped * unit_of(j);
    }
}

void Motion::coefficients(const double* displacement_row, const double* velocity_row, Complex* result) {
    const Level& level = *start_->level;
    const ModalResponse& response = level.response();
    const int r = level.modes(), moving = r + level.prescribed();
    for (int j = 0; j < size(); ++j) {
        const bool is_free = j < free_size_;
        const Complex* shape = is_free ? response.shapes.data() + static_cast<Index>(j) * r
                                       : forced_.data() + (j - free_size_) * forced_.cols();
        Complex value = 0.0, slope = 0.0;
        for (int i = 0; i < (is_free ? r : moving); ++i) {
            value += displacement_row[i] * shape[i];
            slope += velocity_row[i] * shape[i];
        }
        result[j] = value * coefficients_[j];
        rate_[j] = slope * coefficients_[j];
    }
    basis_->differentiate(rate_.data(), rate_.data());
    for (int j = 0; j < size(); ++j) result[j] += rate_[j];
}

}  // namespace multiphi
