#include "batch.hpp"

#include <algorithm>
#include <atomic>
#include <thread>

#include "sampler.hpp"

namespace multiphi {

namespace {

// Calls a function with every number below a count, on several threads.
template <typename Function>
void for_each(int count, int threads, const Function& function) {
    std::atomic<int> next = 0;
    const auto work = [&] {
        for (int k = next++; k < count; k = next++) function(k);
    };
    std::vector<std::thread> pool;
    for (int i = 1; i < std::min(threads, count); ++i) pool.emplace_back(work);
    work();
    for (std::thread& thread : pool) thread.join();
}

}  // namespace

std::vector<BatchRun> run_batch(const std::shared_ptr<Levels>& levels, const std::vector<Start>& starts,
                                const Chatter& chatter, double time, double end, int threads) {
    std::vector<BatchRun> results(starts.size());
    for_each(static_cast<int>(starts.size()), threads, [&](int k) {
        Run run(levels, chatter, time);
        run.share_levels();
        try {
            run.begin(starts[k]);
            run.advance(end, false);
            results[k] = {run.shared_trajectory(), run.final_state(), true};
        } catch (...) {  // whatever it is: alone it happens again
            results[k] = {run.shared_trajectory(), std::nullopt, false};
        }
    });
    return results;
}

std::vector<double> sample_batch(const std::shared_ptr<Levels>& levels,
                                 const std::vector<std::shared_ptr<Trajectory>>& trajectories,
                                 const std::map<Key, Matrix>& rows, const std::vector<double>& times, int threads) {
    const std::size_t count = times.size();
    const Index points = rows.empty() ? 0 : rows.begin()->second.rows();
    const std::size_t of_run = static_cast<std::size_t>(points) * count;
    std::vector<double> result(trajectories.size() * of_run);
    for_each(static_cast<int>(trajectories.size()), threads, [&](int k) {
        Sampler sampler(levels, trajectories[k]);
        const std::vector<Key>& keys = trajectories[k]->keys;
        const int width = *std::max_element(trajectories[k]->widths.begin(), trajectories[k]->widths.end());
        for (Index p = 0; p < points; ++p) {
            Matrix of_levels = Matrix::Zero(static_cast<Index>(keys.size()), 2 * width + 1);
            for (std::size_t number = 0; number < keys.size(); ++number) {
                const Matrix& of_points = rows.at(keys[number]);
                const Index n = of_points.cols() / 2;
                of_levels.row(number).head(n) = of_points.row(p).head(n);
                of_levels(number, 2 * width) = of_points(p, 2 * n);
            }
            sampler.values(times.data(), static_cast<int>(count), Side::right, of_levels,
                           &result[k * of_run + p * count]);
        }
    });
    return result;
}

}  // namespace multiphi
