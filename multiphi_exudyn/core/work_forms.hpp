// Work forms: primitives of the powers in a level, forms whose changes over a segment are the works in it.
//
// y = (eta, eta') of the free response, y' = A y, and a (N,) the coefficients of the channels' carriers at an instant,
//
//     w(t + s) = Re sum_j exp(mu_j s) sum_d a_jd s^d,   a' = M a
//
// (M a)_jd = mu_j a_jd + (d + 1) a_j,d+1. The forced response is Re G a. A power of both,
//
//     Re(a.W y) + Re(a.Q a + a.Q~ conj(a)) / 2,   is d/dt of   Re(a.R y) + Re(a.P a + a.P~ conj(a)) / 2
//     M^T R + R A = W,   M^T P + P M = Q,   M^T P~ + P~ conj(M) = Q~
//
// is solved row by row for R, and element by element for P. If two rates cancel each other, the products of their a are
// polynomials of time, which Gauss-Legendre quadrature integrates exactly.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "excitation.hpp"
#include "linear_algebra.hpp"
#include "power_forms.hpp"
#include "response.hpp"

namespace multiphi {

// The primitives where channels are functions of time: real forms in u = (b, y) (k + 2 r,). b (k,) holds Re a of each
// carrier, power by power, and then Im a if its rate is not real.
struct DrivenForms {
    std::vector<Carrier> carriers;
    Matrix response;                          // G (2 r, k)
    Matrix changing_damping, changing_varying;  // rows b of the primitives (k, k + 2 r)
    Matrix lasting_damping, lasting_varying;    // powers without a primitive, forms in b (k, k)
    std::vector<double> nodes, weights;         // of a quadrature of these on [0, 1]
};

struct WorkForms {
    PowerForms powers;
    // F (2 r, 2 r), symmetric: y.F y grows by the work of damping in a free response; none if the response has powers
    // of time, or friction follows the force of a link. `coupled` (r,): the modes that a mode is coupled to in it.
    std::optional<Matrix> damping;
    std::vector<Range> coupled;
    // Of every exponential of the free response, where `damping` is known and there are channels: eta', and the forces
    // that work on w and on w', (p, r + 2 q).
    ComplexMatrix exponentials;
    // None without prescribed channels, with too many carriers, and where one of these meets a pole.
    std::optional<DrivenForms> driven;

    std::size_t bytes() const;
};

WorkForms work_forms(const Level& level);

}  // namespace multiphi
