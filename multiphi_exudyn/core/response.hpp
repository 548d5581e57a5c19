// Response: the exact free motion of modal equations, as a sum of exponentials.
//
//     eta'' + D eta' + S eta = p,   p constant on modes with omega = 0, zero on the others
//     eta(t) = Re sum_j V_j c_j (t / T)^d_j exp(lambda_j t),   c = A eta(0) + B eta'(0) + P p
//
// S = diag(omega^2) plus coupling by friction, D [1/s]; neither need be symmetric. omega^2 < 0 is a growing mode.
// Constant forces on modes of non-zero frequency belong to the asymptotic configuration, not here.
#pragma once

#include <limits>
#include <vector>

#include "exponentials.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

// Places first, first + 1, ..., end - 1; empty where end is not above first.
struct Range {
    int first = 0;
    int end = 0;
};

// Components y (m,) of a motion, each driven by later ones only: y' = T y + B p, eta = ... + Re V y.
struct Chain {
    ComplexMatrix mixing;  // T (m, m), upper triangular
    ComplexMatrix shapes;  // V^T (m, r)
    ComplexMatrix pushes;  // B (m, r)

    int size() const { return static_cast<int>(mixing.rows()); }
};

struct ModalResponse {
    int modes = 0;  // r
    Exponentials basis;
    std::vector<Range> reached;       // modes of every exponential (p,): its V, A, B and P are zero for the others
    ComplexMatrix from_displacement;  // A (p, r)
    ComplexMatrix from_velocity;      // B (p, r)
    ComplexMatrix from_force;         // P (p, r)
    ComplexMatrix shapes;             // V^T (p, r)
    Vector squares;                   // omega^2 (r,) [rad2/s2]
    Vector half_damping;              // delta = D_ii / 2 (r,) [1/s]
    std::vector<char> uncoupled;      // (r,) modes on their own: eta'' + 2 delta eta' + omega^2 eta = p
    std::vector<char> poles;          // (p,) exponentials of single poles in the motion of the other modes;
    std::vector<Chain> chains;        // chains are the rest of it

    // Sets c (p,) of the motion that starts at eta, eta' (r,) under the modal force p (r,), null for none.
    void coefficients(const double* eta, const double* eta_t, const double* force, Complex* c) const;

    // Sets eta(t), eta'(t) (r,) of the motion with coefficients c (p,). `memory` is kept by the caller.
    void state_at(const Complex* c, double t, std::vector<Complex>& memory, double* eta, double* eta_t) const;
};

// The response for omega^2 (r,), D (r, r) and the coupling S - diag(omega^2) (r, r), which may be empty. duration [s]:
// of the longest motion. Fails where rates are not distinct by more than round-off, and where matrices are not finite.
ModalResponse modal_response(const Vector& squares, const Matrix& damping, const Matrix& coupling = Matrix(),
                             double duration = std::numeric_limits<double>::infinity());

}  // namespace multiphi
