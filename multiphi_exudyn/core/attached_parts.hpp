// Attached parts: masses and constraints of a solver's system at points of the structure, which take part in impacts.
//
//     min |dv|^2 + dw.M_a dw,   dw = R dv = U u,   H (v + dv) >= 0
//
// v (r,) is the modal velocity of the structure, R v (m,) that of its points, M_a (m, m) the inertia attached to them,
// the columns of U (m, k) the velocities that constraints leave them, H the contacts that touch. An impulse i on the
// structure then changes its velocity by
//
//     dv = B i,   B = 1 - R^T X R,   X (R R^T + M_a^-1) = 1 without constraints,
//
// and -X R i is the impulse on it at the points. If R v in a new level's modes has an error e (m,), its velocity changes
// by -R^T X e. The accelerations of contacts at rest follow the same equation. A contact that attached parts leave no
// mobility stays open at its stop without a force, as does one that closed contacts leave none (law/).
#pragma once

#include <vector>

#include "level.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

// M a + C^T mu = f, C a = g: a and mu one after the other (n + k,); redundant constraints share mu.
Vector solve_constrained(const Matrix& mass, const Matrix& jacobian, const Vector& forces, const Vector& prescribed);

// A change dy of the points' velocities changes those of all coordinates connected to them by the least kinetic energy
// that constraints allow, dx = S dy, M_a = S^T M S, without the body's own coordinates and the ties to it.
struct AttachedParts {
    Matrix mass, jacobian;       // M (n, n), C (k, n) of the system, without the ties
    bool acts_on_body = false;   // a mass or a constraint but the ties acts on the body's own coordinates
    bool only_forces = true;     // neither masses nor constraints are attached to the body, there or at its points
    Matrix inertia, free;        // M_a (m, m), U (m, k)
    Matrix follower;             // S (n, m)
    std::vector<int> connected;  // coordinates that move with the points

    // first, size: of the body's own coordinates; own_mass: its M. points: indices of its points' coordinates.
    AttachedParts(Matrix system_mass, Matrix system_jacobian, int first, const Matrix& own_mass,
                  const std::vector<int>& points);
};

// Inertia attached to the points of the structure, whose rows in base coordinates are `in_base` (m, b).
class PointInertia {
  public:
    PointInertia(const Matrix& mass, Matrix free, Matrix in_base);

    const Matrix& mass() const { return mass_; }
    Matrix impedance(const Matrix& rows) const;             // X (m, m) for rows R (m, r) of the points
    // Impulses (m, k) on the points that impulses (b, k) on the structure, in base coordinates, cause.
    Matrix reactions(const Matrix& impulses) const;
    // Of impulses along `directions` (b, k): the changes of the structure's velocity (b, k).
    Matrix responses(const Matrix& directions) const;

    Matrix mobility(const Matrix& rows) const;              // F (r, r) of a level, F F^T = B
    // T' of eta' with which attached masses keep their momentum when modes are truncated, from that without them.
    Matrix velocity_map(const Matrix& before, const Matrix& after, const Matrix& matrix) const;
    // Change (r,) of the modal velocity after which structure and parts, e (m,) apart, move as one at the points.
    Vector joining(const Matrix& rows, const Vector& difference) const;

    // Vectors (l, b) with products u.B u' for unit directions u (l, b) of the links; zero for all but `rigid` ones.
    Matrix reduced(const Matrix& units, const std::vector<int>& rigid) const;
    // Those of the links `rigid` whose directions (l, b) are left no mobility.
    std::vector<int> immovable(const Matrix& directions, const std::vector<int>& rigid) const;

  private:
    Matrix mass_, free_, constrained_, in_base_, base_impedance_;
};

}  // namespace multiphi
