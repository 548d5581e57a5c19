// Defect form: the part of a motion that a level entered from another one cannot hold, as a function of the state before.
//
//     d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta')
//
// P and Q remove the directions of rigid links that hold in the level entered. From level l to level m the state after is
// the image of the state before (eq. 38.6), apart from changes by impacts and by further levels at the same instant:
//
//     s = T xi_l + c - xi_m,   s' = T' xi'_l - xi'_m
//     d = P (Psi_l - Psi_m T) xi_l + P (y_l - y_m - Psi_m c) + P Psi_m s
//     w = Q (Psi_l - Psi_m T') xi'_l + Q Psi_m s'
//
// Triangular factors of these maps from (1, xi_l, s) and (xi'_l, s') are kept. They hold the difference of the levels, so
// no difference of two states is formed.
#pragma once

#include <vector>

#include "linear_algebra.hpp"
#include "transition.hpp"

namespace multiphi {

struct DefectForm {
    Matrix displaced;  // (1 + n_l + n_m, the same): |d| = |displaced (1, xi_l, s)|
    Matrix moving;     // (n_l + n_m, the same): |w / Omega| = |moving (xi'_l, s')|

    // stopped: numbers of links along which an impact has left no velocity.
    explicit DefectForm(const Transition& transition, const std::vector<int>& stopped = {});

    // |d|^2 + |w / Omega|^2 for vectors of the first `count` entries of (xi_l, s) and (xi'_l, s'); the others are zero.
    double squares(const double* displaced_by, const double* moved_by, int count) const;
};

}  // namespace multiphi
