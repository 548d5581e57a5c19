#include "defect_form.hpp"

#include <cmath>

#include "orthonormal.hpp"
#include "triangular_factor.hpp"

namespace multiphi {

namespace {

// Directions (h, m) of the rigid links that hold in a level, and of links that an impact has stopped.
Matrix rigid_directions(const Level& level, const std::vector<int>& stopped) {
    const Base& base = level.model().base;
    std::vector<int> rigid = stopped;
    for (const int link : level.data().links)
        if (base.constrains(link)) rigid.push_back(link);
    return base.directions(rigid, Eigen::all);
}

Matrix shapes(const Level& level) {  // (Psi, R) (m, n)
    Matrix result(level.data().modes.rows(), level.width());
    result << level.data().shapes(), level.data().channel_shapes;
    return result;
}

// The parts of motions (m, k) that directions (h, m) leave.
Matrix allowed(const Matrix& directions, const Matrix& motions) {
    if (directions.rows() == 0) return motions;
    return without(directions, motions.transpose()).transpose();
}

}  // namespace

DefectForm::DefectForm(const Transition& transition, const std::vector<int>& stopped) {
    const Level &source = *transition.source, &target = *transition.target;
    const Matrix held = rigid_directions(target, {}), before = shapes(source), after = shapes(target);
    const int n = source.width(), r = target.width();
    const Vector& periods = source.model().base.periods;
    Matrix motions(before.rows(), 1 + n + r);
    motions.col(0) = source.data().configuration - target.data().configuration - after * transition.offset;
    motions.middleCols(1, n) = before - after * transition.matrix;
    motions.rightCols(r) = after;
    motions = allowed(held, motions);
    displaced = triangular_factor(motions);
    Matrix rates(before.rows(), n + r);
    rates.leftCols(n) = before - after * transition.velocity_matrix;
    rates.rightCols(r) = after;
    moving = triangular_factor(periods.asDiagonal() * allowed(rigid_directions(target, stopped), rates));
}

double DefectForm::squares(const double* displaced_by, const double* moved_by, int count) const {
    const double constant = displaced(0, 0) + scalar_product(displaced.row(0).data() + 1, displaced_by, count);
    double result = constant * constant;
    for (int i = 0; i < count; ++i) {
        const double d = scalar_product(displaced.row(1 + i).data() + 1 + i, displaced_by + i, count - i);
        const double w = scalar_product(moving.row(i).data() + i, moved_by + i, count - i);
        result += d * d + w * w;
    }
    return result;
}

}  // namespace multiphi
