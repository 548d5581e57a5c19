// Forced response: the motion of modal equations under a load that is a polynomial on a carrier, in closed form.
//
//     eta'' + D eta' + S eta = Re( exp(mu t) sum_d p_d u^d ),   eta = Re( exp(mu t) sum_k x_k u^k ),   u = t / T
//
// It is solved mode by mode, D diagonal or not, as the sum of first-order equations of its poles s,
//
//     z' = s z + exp(mu t) p(t),   z = exp(mu t) w,   w' = (s - mu) w + p(t)
//
// w a polynomial of u (particular_solutions.hpp). z belongs to one pole, or to a chain of them (response.hpp), in which
// each is also forced by the later ones. Two poles that (nearly) coincide, of a critically damped mode or a rigid-body
// mode of slow damping or none, are solved as one equation of second order. On the carrier mu = 0 only the real parts
// count, and of a pole and its conjugate one is solved: twice the real part of its response is that to both.
#pragma once

#include <vector>

#include "linear_algebra.hpp"
#include "response.hpp"

namespace multiphi {

class ForcedResponse {  // memory kept between calls
  public:
    // Computes one response x (rows, r) to modal forces p, the first degree + 1 rows of `forces`, on the carrier
    // exp(rate t), in powers of t / unit, for [0, unit]; returns its number of rows. displacement, velocity (r,): of
    // the total motion, whose size the response may have; null for none.
    int compute(const ModalResponse& response, Complex rate, const ComplexMatrix& forces, int degree, double unit,
                const double* displacement, const double* velocity);

    // x (rows, r) of the last call.
    Eigen::Map<const ComplexMatrix> rows() const { return {x_.data(), count_, modes_}; }

  private:
    struct Load;  // what a call was given

    // Each adds the response of a mode, or of a pole or a chain of coupled modes, or of its conjugate, to x.
    void force_mode(const Load& load, int mode);
    void force_pole(const Load& load, int j, bool mirrored);
    void force_chain(const Load& load, const Chain& chain, bool mirrored);

    void add_to_mode(int mode, int count, bool is_real);  // adds w (count,)
    void lengthen(int count);                             // appends zero rows to x, up to `count`

    int count_ = 0, modes_ = 0;
    std::vector<Complex> x_, input_, w_;
    std::vector<std::vector<Complex>> chain_w_;  // of the components of a chain
};

}  // namespace multiphi
