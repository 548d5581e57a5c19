#include "motion_terms.hpp"

#include <algorithm>
#include <utility>

namespace multiphi {

namespace {

// The modes for which one of the term's vectors is not zero; from r to 0 where all are zero.
Range reached_modes(const MotionTerm& term) {
    const int modes = static_cast<int>(term.shape.size());
    Range reached{modes, 0};
    for (int i = 0; i < modes; ++i) {
        if (term.from_displacement[i] != 0.0 || term.from_velocity[i] != 0.0 || term.from_force[i] != 0.0 ||
            term.shape[i] != 0.0) {
            reached.first = std::min(reached.first, i);
            reached.end = i + 1;
        }
    }
    return reached;
}

}  // namespace

void MotionTerms::add(const MotionTerms& other) {
    terms.insert(terms.end(), other.terms.begin(), other.terms.end());
    chains.insert(chains.end(), other.chains.begin(), other.chains.end());
    for (std::size_t i = 0; i < uncoupled.size(); ++i) uncoupled[i] = uncoupled[i] || other.uncoupled[i];
}

ModalResponse MotionTerms::response(const Vector& squares, const Matrix& damping) const {
    const int p = static_cast<int>(terms.size()), r = static_cast<int>(squares.size());
    ModalResponse result;
    std::vector<Complex> rates(p);
    std::vector<int> powers(p);
    result.modes = r;
    result.squares = squares;
    result.half_damping = damping.diagonal() / 2;
    result.uncoupled = uncoupled;
    result.chains = chains;
    result.from_displacement.resize(p, r);
    result.from_velocity.resize(p, r);
    result.from_force.resize(p, r);
    result.shapes.resize(p, r);
    for (int j = 0; j < p; ++j) {
        const MotionTerm& term = terms[j];
        rates[j] = term.rate;
        powers[j] = term.power;
        result.poles.push_back(term.pole);
        result.from_displacement.row(j) = term.from_displacement.transpose();
        result.from_velocity.row(j) = term.from_velocity.transpose();
        result.from_force.row(j) = term.from_force.transpose();
        result.shapes.row(j) = term.shape.transpose();
        result.reached.push_back(reached_modes(term));
    }
    result.basis = Exponentials(std::move(powers), std::move(rates), 1.0);
    return result;
}

}  // namespace multiphi
