#include "batch.hpp"

#include <algorithm>
#include <atomic>
#include <thread>

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

std::vector<BatchRun> run_batch(const std::vector<std::shared_ptr<Levels>>& levels, const std::vector<Start>& starts,
                                const Chatter& chatter, double time, double end, int threads) {
    std::vector<BatchRun> results(starts.size());
    for_each(static_cast<int>(starts.size()), threads, [&](int k) {
        Run run(levels[static_cast<std::size_t>(k)], chatter, time);
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

}  // namespace multiphi
