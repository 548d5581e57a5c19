// Model: the coordinates that all levels share, and the elements (eqs. 38.1, 38.2 with all contacts open).
//
//     x = Phi_0 y,   y'' + C y' + Omega^2 y = loads + forces of the links along their directions
//
// y (m,) are the modal coordinates of the open structure; its modes are mass-normalised. It never changes once it is
// made, so that many runs may share it.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "element.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

struct Base {
    Vector squares;                 // Omega^2 (m,) [rad2/s2]
    Matrix damping;                 // C (m, m) [1/s]
    Matrix directions;              // h of every link (l, m)
    Matrix force_directions;        // along which the links' forces act (l, m); h for most links
    Vector gaps;                    // (l,) [m] at y = 0
    Vector stiffnesses, dampings;   // (l,) [N/m], infinite if rigid; [N s/m]
    Vector preload;                 // (m,) constant forces of force laws
    double energy_offset = 0.0;     // [J] of the links at y = 0
    std::vector<int> held;          // links with a stick position, in their order
    std::vector<int> oblique;       // links whose force acts along another direction than their own
    std::vector<int> residual;      // links that act through the flexibility of the modes left out (residual_boundary.hpp)
    bool general = false;           // some elements have stick positions or constant forces besides their links

    // Whether a link that acts takes a direction from the motion: a rigid one does, but on a residual boundary.
    bool constrains(int link) const {
        return std::isinf(stiffnesses[link]) && std::find(residual.begin(), residual.end(), link) == residual.end();
    }
    int modes() const { return static_cast<int>(squares.size()); }
    int links() const { return static_cast<int>(directions.rows()); }
};

struct Model {
    Base base;
    std::vector<Element> elements;
    std::vector<int> roughest_first;  // elements by friction at rigid contacts: of redundant ones the first carries
    bool is_complete = true;          // its levels keep all modes, so no truncation is to be judged
    int knots = 0;                    // of all force laws

    // Made from the above by `prepare`.
    Matrix unit_directions;           // (l, m)
    Vector omega, periods;            // Omega and 1 / Omega, zero where Omega is zero (m,)
    bool has_friction = false;        // or further links: an impulse may have another direction than its contact

    int size() const { return static_cast<int>(elements.size()); }
    void prepare();
};

}  // namespace multiphi
