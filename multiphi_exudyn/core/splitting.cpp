#include "splitting.hpp"

namespace multiphi {

namespace {

void kick(double step, const Matrix& rows, const Matrix& laws, int modes, double* state) {
    for (Index c = 0; c < rows.rows(); ++c) {
        const double* row = rows.data() + c * modes;
        double gap = laws(c, 0);
        for (int i = 0; i < modes; ++i) gap += row[i] * state[i];
        if (!(gap < 0.0)) continue;
        const double impulse = -0.5 * step * laws(c, 1) * gap;
        for (int i = 0; i < modes; ++i) state[modes + i] += impulse * row[i];
    }
}

}  // namespace

void split_steps(double step, const Matrix& flow, const Matrix& rows, const Matrix& laws, Eigen::Ref<Matrix> record) {
    const int modes = static_cast<int>(record.cols() / 2);
    for (Index k = 0; k + 1 < record.rows(); ++k) {
        double* state = record.row(k + 1).data();
        record.row(k + 1) = record.row(k);
        kick(step, rows, laws, modes, state);
        for (int i = 0; i < modes; ++i) {
            const double z = state[i], velocity = state[modes + i];
            state[i] = flow(0, i) * z + flow(1, i) * velocity;
            state[modes + i] = flow(2, i) * z + flow(3, i) * velocity;
        }
        kick(step, rows, laws, modes, state);
    }
}

}  // namespace multiphi
