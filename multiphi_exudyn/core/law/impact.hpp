// Impact: rigid contacts strike, or their motion presses them to their stops.
//
//     v+ = v- + A^T p,   p >= least,  A v+ >= wanted, complementary,   A = H^T Phi_l     (Moreau; without restitution: 0)
//
// A contact with friction has a second row, along h_t - v_t, and an impulse along it within mu times its first one. Where
// others hang on the structure, an impulse A^T p gives it B A^T p, B = F F^T the mobility that they leave it.
// Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988).
#pragma once

#include <vector>

#include "complementarity.hpp"
#include "energy.hpp"
#include "state.hpp"

namespace multiphi {

namespace impact {

inline constexpr double resting = 1e-12;    // of its possible size: a smaller gap velocity after an impact is zero
inline constexpr double immovable = 1e-11;  // of a contact's mobility: below it attached bodies prevent its motion

// Size of a gap velocity (a row over xi') at the velocities of a state, whose directions an impact mixes.
double velocity_size(const State& state, const double* row);

// The largest gap velocity that the free motion reverses before the gap is above zero by more than round-off; xi'' of the
// state given.
double negligible_velocity(const State& state, int contact, const double* row, const Vector& acceleration);

// The sum of the terms of a gap's acceleration, with the larger one of two states' sizes.
double resting_size(const Vector& one, const Vector& other, const double* row);

// Whether an impact has changed no velocity by more than round-off.
bool same_velocity(const State& before, const State& after);

}  // namespace impact

class Impact {
  public:
    explicit Impact(const Model& model);

    // Poses the problem of gap velocities of contacts (or links) as rows over xi', the last `held` with opposite sign.
    void fill_rows(const Level& level, const std::vector<int>& contacts, int held = 0);
    const double* row(int k) const { return problem.rows[k]; }

    // Appends rows of tangential velocities of contacts with friction and returns the number of all rows; the impulse
    // along each is limited by that of its contact. `released`: null for an impact. For forces at rest it is the state
    // before the impact: a contact that slides after it has no row, but its normal force brings friction with it.
    int add_friction_rows(const State& state, const std::vector<int>& contacts, const State* released);

    // Solves for the smallest change (r,) of a vector v (n,) with rows v >= wanted. Throws NumericalFailure where there is
    // none. sizes: of terms of rows v besides those of v itself; wanted, least: of the contacts; each null for zeros.
    void least_change(const Level& level, const std::vector<int>& contacts, const Vector& vector,
                      const std::vector<double>* sizes, const std::vector<double>* wanted,
                      const std::vector<double>* least);

    // 2. Moreau's impact in a level in which the contacts are open: the state after it, and its losses are added.
    // held: number of last contacts that get no velocity away from their stops either. wanted: lower bounds of the gap
    // velocities, least: of the impulses, null for zeros. impulses: [N s] of the contacts, then of their friction.
    void collide(const State& state, const std::vector<int>& contacts, int held, const std::vector<double>* wanted,
                 const std::vector<double>* least, const Inputs& inputs, State& result, std::vector<double>& impulses,
                 Loss& loss);

    SmallProblem problem;     // with the solution of the last one; its first rows are those of the contacts
    std::vector<int> enters;  // of every element: the state that it enters when it closes, stick or slip (10)

  private:
    void limit_rows(const Level& level, int count);
    void limit_change(const Level& level);

    const Model* model_;
    std::vector<double> memory_;
};

}  // namespace multiphi
