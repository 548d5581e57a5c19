// Motion terms: a motion while it is being put together, term by term.
//
//     eta(t) = Re sum_j V_j (A_j eta(0) + B_j eta'(0) + P_j p) t^d_j exp(lambda_j t)
#pragma once

#include <vector>

#include "response.hpp"

namespace multiphi {

struct MotionTerm {
    Complex rate = 0.0;  // lambda [1/s]
    int power = 0;       // d
    bool pole = false;   // a single pole of coupled modes
    ComplexVector from_displacement, from_velocity, from_force, shape;  // A, B, P, V (r,)

    MotionTerm(Complex given_rate, int given_power, int modes)
        : rate(given_rate), power(given_power), from_displacement(ComplexVector::Zero(modes)),
          from_velocity(ComplexVector::Zero(modes)), from_force(ComplexVector::Zero(modes)),
          shape(ComplexVector::Zero(modes)) {}
};

struct MotionTerms {
    std::vector<MotionTerm> terms;
    std::vector<char> uncoupled;  // (r,)
    std::vector<Chain> chains;

    explicit MotionTerms(int modes) : uncoupled(modes, false) {}

    // Adds another motion of the same modes.
    void add(const MotionTerms& other);

    // The response that the terms make up.
    ModalResponse response(const Vector& squares, const Matrix& damping) const;
};

}  // namespace multiphi
