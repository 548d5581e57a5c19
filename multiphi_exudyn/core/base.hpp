// Base: the coordinates in which every level is a small dense problem, and the links in them (eq. 38.2, all open).
//
//     x = Phi_0 y,   y'' + C y' + Omega^2 y = loads + forces of the links along their directions
//
// y (m,) are the modal coordinates of the open structure; its modes are mass-normalised. Closed contacts add
//
//     closed rigid contacts      H_r^T y = -gap
//     closed compliant contacts  K_l = diag(Omega^2) + H_c diag(k) H_c^T,   C_l = C + H_c diag(c) H_c^T
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

struct Base {
    Vector squares;                 // Omega^2 (m,) [rad2/s2]
    int rigid_body_modes = 0;       // number of coordinates with Omega = 0, which come first
    Matrix damping;                 // C (m, m) [1/s]
    Matrix directions;              // h of every link (l, m)
    Matrix force_directions;        // along which the links' forces act (l, m); h for most links
    Vector stiffnesses, dampings;   // (l,) [N/m], infinite if rigid; [N s/m]
    Vector preload;                 // (m,) constant forces of force laws
    double energy_offset = 0.0;     // [J] of the links at y = 0
    std::vector<int> held;          // links with a stick position, in their order
    std::vector<int> oblique;       // links whose force acts along another direction than their own
    std::vector<int> residual;      // links that act through the flexibility of the modes left out (residual_boundary.hpp)
    bool general = false;           // some elements have stick positions or constant forces besides their links
    std::vector<int> parallel;      // of every link the first link of the same direction, up to its sign
    Matrix points;                  // rows of the structure's points (p, m)
    std::vector<std::string> names;   // of the links, and
    std::vector<std::string> labels;  //   of their elements where a link has no name that a user has given

    // Made from the above by `prepare`.
    Vector omega, periods;          // Omega and 1 / Omega, zero where Omega is zero (m,)
    Matrix observed;                // rows of links, then of points (k, m), which choose signs and bases of modes
    Vector sizes;                   // of these rows, then of the coordinates, in a mode of length one (k + m,)
    Matrix sizes_of_directions;     // |h| (l, m), component by component
    Vector springs;                 // (l,) stiffnesses, zero of rigid links, which store no energy
    std::optional<Vector> modal_damping;  // the diagonal of C where C is diagonal
    Vector lowest, highest;         // Omega^2 -+ the amount by which round-off may violate the interlacing theorem
    Vector orientation;             // the sign (l,) of its direction relative to that of the first parallel one

    int modes() const { return static_cast<int>(squares.size()); }
    int links() const { return static_cast<int>(directions.rows()); }
    bool is_rigid(int link) const;
    bool is_residual(int link) const;
    // Whether a link that acts takes a direction from the motion: a rigid one does, but on a residual boundary.
    bool constrains(int link) const { return is_rigid(link) && !is_residual(link); }
    // |h| (l,): the sizes that bound the round-off of a mode's gaps.
    auto lengths() const { return sizes.head(links()); }
    // Whether the directions of these rigid links are linearly independent: they can close together.
    bool are_independent(const std::vector<int>& rigid) const;
    // C_l v of vectors (r, m), one a row, with these links closed.
    Matrix damped(const std::vector<int>& closed, const Matrix& vectors) const;
    // The largest element of C_l, which is on its diagonal, as C_l is positive semidefinite.
    double largest_damping(const std::vector<int>& closed) const;
    // The sums (r,) of |stiffnesses| of the structure and of closed springs along modes (r, m).
    Vector stiffness_sizes(const std::vector<int>& closed, const Matrix& modes) const;

    void prepare();
};

}  // namespace multiphi
