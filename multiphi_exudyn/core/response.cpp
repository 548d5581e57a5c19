#include "response.hpp"

#include <optional>

#include "coupled_modes.hpp"
#include "light_damping.hpp"
#include "uncoupled_modes.hpp"

namespace multiphi {

void ModalResponse::coefficients(const double* eta, const double* eta_t, const double* force, Complex* c) const {
    for (int j = 0; j < basis.size(); ++j) {
        const Range& range = reached[j];
        Complex sum = 0.0;
        for (int i = range.first; i < range.end; ++i) {
            sum += from_displacement(j, i) * eta[i] + from_velocity(j, i) * eta_t[i];
        }
        if (force != nullptr) {
            for (int i = range.first; i < range.end; ++i) sum += from_force(j, i) * force[i];
        }
        c[j] = sum;
    }
}

void ModalResponse::state_at(const Complex* c, double t, std::vector<Complex>& memory, double* eta,
                             double* eta_t) const {
    const int p = basis.size();
    memory.resize(2 * static_cast<std::size_t>(p));
    Complex *phi = memory.data(), *rate = phi + p;
    basis.evaluate(t, phi);
    basis.differentiate(c, rate);
    for (int i = 0; i < modes; ++i) eta[i] = eta_t[i] = 0.0;
    for (int j = 0; j < p; ++j) {
        const Complex value = c[j] * phi[j], slope = rate[j] * phi[j];
        for (int i = reached[j].first; i < reached[j].end; ++i) {
            const Complex shape = shapes(j, i);
            eta[i] += shape.real() * value.real() - shape.imag() * value.imag();
            eta_t[i] += shape.real() * slope.real() - shape.imag() * slope.imag();
        }
    }
}

ModalResponse modal_response(const Vector& squares, const Matrix& damping, const Matrix& coupling, double duration) {
    Matrix stiffness = squares.asDiagonal();
    if (coupling.size() > 0 && !coupling.isZero(0.0)) {
        stiffness += coupling;
        return coupled_motion(squares, stiffness, damping, duration).response(squares, damping);
    }
    if (is_diagonal(damping)) return uncoupled_motion(squares, damping, duration).response(squares, damping);
    const std::optional<ModalResponse> light = lightly_damped_response(squares, damping);
    if (light) return *light;
    return coupled_motion(squares, stiffness, damping, duration).response(squares, damping);
}

}  // namespace multiphi
