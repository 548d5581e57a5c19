#include "decompositions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "failure.hpp"

namespace multiphi {

namespace {

constexpr double reduced = 0.95;         // of the norms of a row and its column: a smaller reduction is left out
constexpr double largest_scale = 1e150;  // of a row: larger ones would overflow

// A matrix whose rows and columns are exchanged, so that eigenvalues that stand alone are isolated, and of which the
// rest is scaled by powers of two, so that rows and columns are alike: eigenvalues of small parts keep their digits
// beside large ones. E. Anderson et al., LAPACK Users' Guide, 3rd ed. 1999, sec. 4.8.1.2.
class Balanced {
  public:
    explicit Balanced(const Matrix& system) : matrix_(system), scales_(Vector::Ones(system.rows())) {
        last_ = matrix_.rows() - 1;
        while (isolate_row()) --last_;
        while (isolate_column()) ++first_;
    }

    void scale() {
        bool changed = true;
        while (changed) {
            changed = false;
            for (Index i = first_; i <= last_; ++i) changed = scale_row(i) || changed;
        }
    }

    const Matrix& matrix() const { return matrix_; }

    // The rows of vectors of the balanced matrix, as those of the given one.
    void undo(ComplexMatrix& vectors) const {
        for (Index i = 0; i < vectors.rows(); ++i) vectors.row(i) *= scales_[i];
        for (auto exchange = exchanges_.rbegin(); exchange != exchanges_.rend(); ++exchange) {
            vectors.row(exchange->first).swap(vectors.row(exchange->second));
        }
    }

  private:
    // Moves a row without off-diagonal elements among the rows that are left to their end; whether there was one.
    bool isolate_row() {
        for (Index j = last_; j >= first_; --j) {
            if (is_row_alone(j)) {
                exchange(j, last_);
                return last_ > 0;
            }
        }
        return false;
    }

    // Moves a column without off-diagonal elements to the begin; whether there was one.
    bool isolate_column() {
        for (Index j = first_; j <= last_; ++j) {
            if (is_column_alone(j)) {
                exchange(j, first_);
                return first_ < last_;
            }
        }
        return false;
    }

    bool is_row_alone(Index j) const {
        for (Index i = first_; i <= last_; ++i) {
            if (i != j && matrix_(j, i) != 0.0) return false;
        }
        return true;
    }

    bool is_column_alone(Index j) const {
        for (Index i = first_; i <= last_; ++i) {
            if (i != j && matrix_(i, j) != 0.0) return false;
        }
        return true;
    }

    void exchange(Index i, Index j) {
        if (i == j) return;
        matrix_.row(i).swap(matrix_.row(j));
        matrix_.col(i).swap(matrix_.col(j));
        exchanges_.emplace_back(i, j);
    }

    bool scale_row(Index i) {
        const Index count = last_ - first_ + 1;
        double column = matrix_.col(i).segment(first_, count).norm();
        double row = matrix_.row(i).segment(first_, count).norm();
        if (!(column > 0.0) || !(row > 0.0)) return false;
        const double sum = column + row;
        double factor = 1.0;
        while (column < row / 2.0 && factor < largest_scale) {
            factor *= 2.0;
            column *= 2.0;
            row /= 2.0;
        }
        while (column / 2.0 >= row && factor > 1.0 / largest_scale) {
            factor /= 2.0;
            column /= 2.0;
            row *= 2.0;
        }
        const double scaled = factor * scales_[i];
        if (column + row >= reduced * sum || !(scaled < largest_scale && scaled > 1.0 / largest_scale)) return false;
        scales_[i] = scaled;
        matrix_.row(i) /= factor;
        matrix_.col(i) *= factor;
        return true;
    }

    Matrix matrix_;
    Vector scales_;
    Index first_ = 0, last_ = 0;  // the part that is left
    std::vector<std::pair<Index, Index>> exchanges_;
};

using Line = Eigen::Ref<ComplexVector, 0, Eigen::InnerStride<>>;  // a row or a column

// Rotation of two rows or columns: x' = c x + s y, y' = c y - conj(s) x, with which f c + g s = r and 0.
struct Rotation {
    double c = 1.0;
    Complex s = 0.0;

    Rotation(Complex f, Complex g) {
        const double size_f = std::abs(f), size_g = std::abs(g), size = std::hypot(size_f, size_g);
        if (size_g == 0.0) return;
        c = size_f / size;
        s = size_f == 0.0 ? std::conj(g) / size_g : f / size_f * (std::conj(g) / size);
    }

    void turn(Line x, Line y) const {
        for (Index i = 0; i < x.size(); ++i) {
            const Complex one = x[i], other = y[i];
            x[i] = c * one + s * other;
            y[i] = c * other - std::conj(s) * one;
        }
    }
};

// Exchanges the eigenvalues at k and k + 1.
void exchange_neighbours(Schur& schur, Index k) {
    ComplexMatrix& t = schur.triangle;
    const Index rest = t.cols() - k - 2;
    const Complex one = t(k, k), other = t(k + 1, k + 1);
    Rotation rotation(t(k, k + 1), other - one);
    rotation.turn(t.row(k).tail(rest).transpose(), t.row(k + 1).tail(rest).transpose());
    rotation.s = std::conj(rotation.s);
    rotation.turn(t.col(k).head(k), t.col(k + 1).head(k));
    rotation.turn(schur.basis.col(k), schur.basis.col(k + 1));
    t(k, k) = other;
    t(k + 1, k + 1) = one;
}

}  // namespace

Eigenpairs eigenpairs(const Matrix& system) {
    const Index n = system.rows();
    Eigenpairs result{ComplexVector(n), ComplexMatrix::Zero(n, n)};
    if (n == 0) return result;
    Balanced balanced(system);
    balanced.scale();
    const Eigen::EigenSolver<Eigen::MatrixXd> solver(balanced.matrix());
    if (solver.info() != Eigen::Success) throw NumericalFailure(Cause::indistinct_modes);
    result.rates = solver.eigenvalues();
    const Eigen::MatrixXd& parts = solver.pseudoEigenvectors();  // real, then imaginary part of a pair
    for (Index j = 0; j < n; ++j) {
        if (result.rates[j].imag() == 0.0 || j + 1 == n) {
            result.vectors.col(j) = parts.col(j).cast<Complex>();
        } else {
            result.vectors.col(j).real() = parts.col(j);
            result.vectors.col(j).imag() = parts.col(j + 1);
            result.vectors.col(j + 1) = result.vectors.col(j).conjugate();
            ++j;
        }
    }
    balanced.undo(result.vectors);
    for (Index j = 0; j < n; ++j) result.vectors.col(j).normalize();
    return result;
}

Schur complex_schur(const Matrix& system) {
    if (system.rows() == 0) return {};
    const Balanced balanced(system);
    const Eigen::HessenbergDecomposition<Eigen::MatrixXd> hessenberg(balanced.matrix());
    const Eigen::MatrixXd reduced_matrix = hessenberg.matrixH(), reduction = hessenberg.matrixQ();  // real, as A is
    Eigen::ComplexSchur<Eigen::MatrixXcd> solver(system.rows());
    solver.computeFromHessenberg(reduced_matrix.cast<Complex>(), reduction.cast<Complex>());
    if (solver.info() != Eigen::Success) throw NumericalFailure(Cause::indistinct_modes);
    Schur result{solver.matrixT(), solver.matrixU()};
    balanced.undo(result.basis);
    return result;
}

void Schur::bring_forward(const std::vector<int>& places) {
    Index first = 0;
    for (const int place : places) {
        for (Index k = place - 1; k >= first; --k) exchange_neighbours(*this, k);
        ++first;
    }
}

double condition(const Matrix& matrix) {
    if (!matrix.allFinite()) return std::numeric_limits<double>::infinity();
    if (matrix.size() == 0) return 1.0;
    const Vector values = Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::NoQRPreconditioner>(matrix).singularValues();
    return values[values.size() - 1] > 0.0 ? values[0] / values[values.size() - 1]
                                           : std::numeric_limits<double>::infinity();
}

double condition(const ComplexMatrix& matrix) {
    const Index n = matrix.rows();
    Matrix real(2 * n, 2 * n);  // has every singular value twice
    real << matrix.real(), -matrix.imag(), matrix.imag(), matrix.real();
    return condition(real);
}

OrthogonalTriangular orthogonal_triangular(const Matrix& matrix) {
    const Index n = matrix.cols();
    const Eigen::HouseholderQR<Eigen::MatrixXd> factors{Eigen::MatrixXd(matrix)};
    OrthogonalTriangular result{Matrix::Identity(matrix.rows(), n), Matrix::Zero(n, n)};
    Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(matrix.rows(), n);
    basis.applyOnTheLeft(factors.householderQ());
    result.basis = basis;
    result.triangle = factors.matrixQR().topRows(n).triangularView<Eigen::Upper>();
    return result;
}

Matrix null_space(const Matrix& matrix) {
    const Index m = matrix.rows(), n = matrix.cols();
    if (n == 0) return Matrix::Identity(m, m);
    const Eigen::HouseholderQR<Eigen::MatrixXd> factors{Eigen::MatrixXd(matrix)};
    Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(m, m).rightCols(m - n);
    basis.applyOnTheLeft(factors.householderQ());
    return basis;
}

LeftSingularVectors left_singular_vectors(const Matrix& matrix) {
    if (matrix.size() == 0) return {Matrix(matrix.rows(), 0), Vector(0)};
    const Eigen::BDCSVD<Eigen::MatrixXd> factors(matrix, Eigen::ComputeThinU);
    return {factors.matrixU(), factors.singularValues()};
}

LinearSolver::LinearSolver(Matrix matrix) : matrix_(std::move(matrix)) {
    const Index n = matrix_.rows();
    if (n == 0) return;
    const Eigen::PartialPivLU<Eigen::MatrixXd> factors{Eigen::MatrixXd(matrix_)};
    triangles_ = factors.matrixLU();
    is_singular_ = (triangles_.diagonal().array() == 0.0).any();
    rows_.resize(static_cast<std::size_t>(n));
    const auto& places = factors.permutationP().indices();
    for (Index i = 0; i < n; ++i) rows_[static_cast<std::size_t>(places[i])] = static_cast<int>(i);
}

Vector LinearSolver::solution(const Vector& b) const {
    if (matrix_.rows() == 0) return Vector(0);
    if (is_singular_) return least_squares(matrix_, b);
    Vector result = b(rows_);
    triangles_.triangularView<Eigen::UnitLower>().solveInPlace(result);
    triangles_.triangularView<Eigen::Upper>().solveInPlace(result);
    return result;
}

Vector least_squares(const Matrix& a, const Vector& b) {
    if (a.cols() == 0) return Vector(0);
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factors;
    factors.setThreshold(std::numeric_limits<double>::epsilon() * static_cast<double>(std::max(a.rows(), a.cols())));
    factors.compute(a);
    return factors.solve(b);
}

double determinant(const Matrix& matrix) {
    return matrix.rows() == 0 ? 1.0 : Eigen::PartialPivLU<Eigen::MatrixXd>(matrix).determinant();
}

Matrix solve(const Matrix& a, const Matrix& b) {
    if (a.rows() == 0) return Matrix(0, b.cols());
    return Eigen::PartialPivLU<Eigen::MatrixXd>(a).solve(b);
}

ComplexMatrix solve(const ComplexMatrix& a, const ComplexMatrix& b) {
    return Eigen::PartialPivLU<Eigen::MatrixXcd>(a).solve(b);
}

ComplexMatrix inverse(const ComplexMatrix& a) {
    return Eigen::PartialPivLU<Eigen::MatrixXcd>(a).inverse();
}

Matrix inverse(const Matrix& a) {
    return Eigen::PartialPivLU<Eigen::MatrixXd>(a).inverse();
}

}  // namespace multiphi
