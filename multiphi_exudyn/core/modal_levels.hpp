// Modal levels: the levels of one model, whatever its loads, built from the base on first use.
//
// Any number of runs may use them at once. Those used least recently are forgotten where more are kept than a bound
// allows; who uses one keeps it.
#pragma once

#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "residual_boundary.hpp"
#include "sliding.hpp"

namespace multiphi {

class ModalLevels {
  public:
    ModalLevels(std::shared_ptr<const Base> base, KeptModes kept) : base_(std::move(base)), kept_(std::move(kept)) {}

    const std::shared_ptr<const Base>& base() const { return base_; }
    // The level of these closed links, in ascending order. Throws LevelFailure where there is none.
    std::shared_ptr<const MovingLevel> level(const std::vector<int>& links);

    // The residual contacts beside the level of these closed links, of which none is residual.
    std::shared_ptr<const ResidualBoundary> boundary(const std::vector<int>& host);

    int built() const;                     // number of levels built so far, including those built again
    int count() const;                     // of those that are kept
    double highest_frequency() const;      // [Hz] of these
    void set_most(int most);               // number of levels that are kept

  private:
    struct Entry {
        std::shared_ptr<const MovingLevel> level;
        std::list<std::vector<int>>::iterator use;
        std::shared_ptr<const ResidualBoundary> boundary;  // of this level as a host, if one was asked for
    };

    std::shared_ptr<const MovingLevel> make(const std::vector<int>& links);
    void forget();

    std::shared_ptr<const Base> base_;
    KeptModes kept_;
    mutable std::mutex mutex_;
    std::map<std::vector<int>, Entry> levels_;
    std::list<std::vector<int>> uses_;  // the last used one first
    int built_ = 0, most_ = std::numeric_limits<int>::max();
};

}  // namespace multiphi
