// Motion: the closed form of a level's motion from a state on (eq. 38.3), also called its flow.
//
//     xi(t) = Re V (c phi(t)) + Re sum_j exp(mu_j t) sum_k x_jk (t / T)^k
//
// the free response and the response to the terms of the channels, T the horizon. Held channels keep their values.
#pragma once

#include <vector>

#include "excitation.hpp"
#include "exponentials.hpp"
#include "forced_response.hpp"
#include "level.hpp"
#include "state.hpp"

namespace multiphi {

class Motion {
  public:
    // Begins at a state, under the terms of the inputs. The state must outlive the motion.
    void begin(const State& state, const Inputs& inputs);

    const State& start() const { return *start_; }
    const Level& level() const { return *start_->level; }
    const Exponentials& basis() const { return *basis_; }
    int size() const { return basis_->size(); }     // p, of all exponentials
    int free_size() const { return free_size_; }    // of these the first ones, of the free response

    void state_at(double t, Vector& displacement, Vector& velocity);
    // The state a step after that of the last call, for a motion without powers of time; same_step: as in the last call.
    void next_state(double step, bool same_step, Vector& displacement, Vector& velocity);
    // phi (p,) of the last evaluation.
    const std::vector<Complex>& exponentials() const { return phi_; }
    // Raises the scales of a state to the sizes of the terms of which the last `state_at` has summed it.
    void raise_scales(State& state) const;

    // Coefficients (p,) of a signal on the exponentials, without its constant, and the sizes of their terms.
    void signal(const Signal& signal, Complex* result);
    void signal_sizes(const Signal& signal, double* result);
    // Coefficients (p,) of a row that is no signal of the level.
    void coefficients(const double* displacement_row, const double* velocity_row, Complex* result);

    const std::vector<Complex>& coefficients() const { return coefficients_; }  // c (p,), one for forced terms
    const ComplexMatrix& forced_shapes() const { return forced_; }              // x_jk (p - free, r + prescribed)

  private:
    void respond_to(const Inputs& inputs);
    void add_forced(const Term& term, int rows, double horizon);
    void drive_free_modes();
    double unit_of(int j) const;
    void sum(Vector& displacement, Vector& velocity) const;
    void size_terms();

    const State* start_ = nullptr;
    const Exponentials* basis_ = nullptr;  // of the free response, or all_exponentials_
    Exponentials all_exponentials_;        // with those of the channels
    int free_size_ = 0;
    std::vector<Complex> coefficients_;
    ComplexMatrix forced_;
    int forced_count_ = 0;
    Vector own_displacement_, own_velocity_;  // of the start without the forced response (r,)
    Vector free_force_;                       // on zero-frequency modes (r,)
    ForcedResponse forced_response_;
    ComplexMatrix scaled_term_, modal_forces_;
    // memory of evaluations: exponentials at a time, those of a step, coefficients of derivatives, sizes of terms
    std::vector<Complex> phi_, step_, rate_;
    std::vector<double> term_sizes_;
    mutable Vector displacement_sizes_, velocity_sizes_;
};

}  // namespace multiphi
