// Vectors and matrices of the core. Matrices are stored by rows, as numpy's are: a row is one signal, one force.
#pragma once

#include <complex>
#include <vector>

#include <Eigen/Core>

namespace multiphi {

using Complex = std::complex<double>;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ComplexVector = Eigen::VectorXcd;
using ComplexMatrix = Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Index = Eigen::Index;

// a b and its real part by the products of the parts: std::complex's own operator also looks for infinities to repair,
// in every pass of a loop.
inline Complex product(const Complex& a, const Complex& b) {
    return Complex(a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real());
}
inline double real_product(const Complex& a, const Complex& b) { return a.real() * b.real() - a.imag() * b.imag(); }

}  // namespace multiphi
