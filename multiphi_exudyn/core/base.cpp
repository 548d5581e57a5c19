#include "base.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "orthonormal.hpp"

namespace multiphi {

namespace {

constexpr double interlacing = 1e-8;  // relative violation of the interlacing theorem that is still round-off

}  // namespace

bool Base::is_rigid(int link) const { return std::isinf(stiffnesses[link]); }

bool Base::is_residual(int link) const { return std::find(residual.begin(), residual.end(), link) != residual.end(); }

bool Base::are_independent(const std::vector<int>& rigid) const {
    if (static_cast<int>(rigid.size()) > modes()) return false;
    if (rigid.size() == 1) return sizes[rigid[0]] > 0.0;
    OrthonormalBasis basis;
    return span(directions, lengths(), rigid, basis);
}

Matrix Base::damped(const std::vector<int>& closed, const Matrix& vectors) const {
    Matrix result = modal_damping ? Matrix(vectors * modal_damping->asDiagonal()) : Matrix(vectors * damping);
    for (const int link : closed) {
        if (dampings[link] == 0.0) continue;
        const Vector rates = vectors * directions.row(link).transpose();
        result += (dampings[link] * rates) * directions.row(link);
    }
    return result;
}

double Base::largest_damping(const std::vector<int>& closed) const {
    Vector diagonal = damping.diagonal();
    for (const int link : closed) {
        if (dampings[link] != 0.0) diagonal += dampings[link] * directions.row(link).cwiseAbs2().transpose();
    }
    return diagonal.size() > 0 ? std::max(0.0, diagonal.maxCoeff()) : 0.0;
}

Vector Base::stiffness_sizes(const std::vector<int>& closed, const Matrix& vectors) const {
    Vector result = vectors.cwiseAbs2() * squares;
    for (const int link : closed) {
        if (springs[link] == 0.0) continue;
        result += std::abs(springs[link]) * (vectors * directions.row(link).transpose()).cwiseAbs2();
    }
    return result;
}

void Base::prepare() {
    const int m = modes(), l = links();
    omega.resize(m);
    periods.resize(m);
    for (int i = 0; i < m; ++i) {
        omega[i] = std::sqrt(squares[i]);
        periods[i] = omega[i] > 0.0 ? 1.0 / omega[i] : 0.0;
    }
    observed.resize(l + points.rows(), m);
    observed << directions, points;
    sizes.setOnes(observed.rows() + m);
    sizes.head(observed.rows()) = observed.rowwise().norm();
    sizes_of_directions = directions.cwiseAbs();
    springs = stiffnesses;
    for (int link = 0; link < l; ++link) {
        if (is_rigid(link)) springs[link] = 0.0;
    }
    const Vector diagonal = damping.diagonal();
    if ((damping.array() != 0.0).count() == (diagonal.array() != 0.0).count()) modal_damping = diagonal;
    const double largest = m > 0 ? squares.maxCoeff() : 0.0;
    const Vector slack = interlacing * squares.array() + std::numeric_limits<double>::epsilon() * largest;
    lowest = squares - slack;
    highest = squares + slack;
    orientation.setOnes(l);
    for (int link = 0; link < l; ++link) {
        if (directions.row(link).dot(directions.row(parallel[link])) < 0.0) orientation[link] = -1.0;
    }
}

}  // namespace multiphi
