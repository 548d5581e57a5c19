// Work integrals: works in segments that a run has left out (work.hpp), in closed form, from products of exponentials.
//
//     f(t) = Re sum_j F_j phi_j,   f g = 1/2 Re sum_jk F_j G_k phi_j phi_k + F_j conj(G_k phi_k) phi_j
//
// for the factors f and g of each power (power_forms.hpp): it needs no exponentials but those at the end. Where the
// free response has no powers of time, its own share of damping is the change of a form (work_forms.hpp). A chain is a
// rate with its powers of time: the products of two chains are (t / T)^d exp(s t), s the sum of their rates, and d goes
// up to the sum of their degrees.
#pragma once

#include <vector>

#include "excitation.hpp"
#include "motion.hpp"
#include "work.hpp"

namespace multiphi {

class WorkIntegrals {
  public:
    // The works of the segment from a state on, under inputs with the horizon of its motion. entry_work [J]: of jumps
    // at its start. The inputs are left as they are. What springs take up whose stretch follows the force of a link is
    // no work of friction.
    Works integrate(const State& start, Inputs& inputs, double duration, double entry_work);

  private:
    // Factors of the exponentials, of degree d, in the integrals of the powers of two chains.
    struct Products {
        Complex damping = 0.0, varying = 0.0, friction = 0.0;
    };

    void begin(const State& start, Inputs& inputs);
    double spring_energy(const State& state) const;
    double free_damping_work(const WorkForms& forms, double duration);
    void list_terms(int first);
    void list_factors(const WorkForms& forms);
    void add_constants(const PowerForms& powers, Works& works) const;
    void add_friction(const PowerForms& powers, Works& works) const;
    void add_products(const WorkForms& forms, double duration, Works& works);
    bool multiply(const WorkForms& forms, int a, int length, int b, int further);
    void add_integrals(const std::vector<Products>& products, Complex rate, Complex end, int count, double duration,
                       Works& works) const;
    int chain_length(int first) const;
    Complex change_of(int j) const;  // of an exponential, from start to end

    Motion motion_;
    State end_;
    double largest_square_ = 0.0;  // |eta'|^2 + |omega eta|^2 at the starts so far
    int closed_count_ = 0;         // of first exponentials whose products need no integral
    std::vector<Complex> phi_;     // at the end of the segment (p,)
    std::vector<double> powers_of_end_;                        // (t / T)^d at the end
    ComplexMatrix displacement_, velocity_, acceleration_;     // coefficients (p, n) of xi, xi', xi''
    ComplexMatrix damped_, on_value_, on_rate_;                // of D xi' (p, n), and of what works on w and w' (p, q)
    ComplexMatrix limits_, slips_;                             // of T_e and s_e.xi' (p, s)
    std::vector<Products> plain_, mirrored_;                   // by degree; mirrored: with the second chain's conjugate
    std::vector<double> sum_, change_;                         // of y (2 r,)
};

}  // namespace multiphi
