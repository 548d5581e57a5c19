// Works of damping, of varying loads and of friction in a segment of a run, in closed form: entries of the ledger.
//
//     damping   y.F y + Re(a.R y) + Re(a.P a + a.P~ conj(a)) / 2
//     varying   the same without F, and its constant force times the change of w
//     friction  its constant forces times the change of xi
//
// Each is the change of a primitive of its power (work_forms.hpp): y = (eta, eta') without the forced response to the
// channels, at the two ends of the segment. A segment without primitives, or in which y is much larger than the motion,
// is left out: the products of its exponentials are integrated (work_integrals.hpp) when a ledger needs it.
#pragma once

#include <vector>

#include "level.hpp"
#include "state.hpp"
#include "work_forms.hpp"

namespace multiphi {

struct Works {
    double damping = 0.0, varying = 0.0, friction = 0.0;

    Works& operator+=(const Works& other);
};

// Of energies: differences lose so much accuracy where the free response is so much larger than the motion.
inline constexpr double large_free_response = 100.0;

// (y_1 + y_0).F (y_1 - y_0) from the sum and the difference (2 r,) of y: the work of damping [J].
double damping_work(const WorkForms& forms, const double* sum, const double* change);

// Sums works as segments end. It knows the largest energy of its run so far.
class WorkSums {
  public:
    // Sets the works of the segment between two states of one level, under the terms of the channels there; false where
    // it has to be left out.
    bool add_segment(const State& start, const State& end, const std::vector<Term>& terms_at_start,
                     const std::vector<Term>& terms_at_end, double duration, Works& works);

  private:
    bool is_free_response_large(const State& start, const double* free);

    double largest_square_ = 0.0;                // twice the largest energy so far, at the instants sampled
    Vector first_, last_, sum_, change_, mean_;  // u = (b, y) at the two ends; b at a node of a quadrature
};

}  // namespace multiphi
