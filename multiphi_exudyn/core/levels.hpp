// Levels: the levels of one model under the loads of a run, and the transitions between them, made on first use.
//
// Any number of runs may use them at once. A level is asked for by its key; the model has its modes, everything else is
// made here. What has been made keeps its address until it is forgotten.
#pragma once

#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <utility>

#include "defect_form.hpp"
#include "level.hpp"
#include "transition.hpp"

namespace multiphi {

class Levels {
  public:
    // duration: of the longest motion in them [s].
    Levels(std::shared_ptr<const Model> model, std::shared_ptr<const Excitation> excitation, double duration);
    virtual ~Levels() = default;

    const Model& model() const { return *model_; }
    const Excitation& excitation() const { return *excitation_; }
    const Level& base() const { return base_; }
    double duration() const { return duration_; }
    // What is known of the level of a key; throws LevelFailure where there is none.
    LevelData data(const Key& key) const;

    virtual const Level& level(const Key& key);
    virtual const Transition& transition(const Level& source, const Level& target);
    // The signal that a guard's element would have in the level that it enters alone.
    virtual const Signal& entered_signal(const Level& level, int guard);
    const DefectForm& defect_form(const Transition& transition);

    virtual std::size_t bytes() const;
    // Forgets all levels, or all but one, which keeps its address; only where no other run uses them.
    void forget_but(const Level& kept);
    virtual void forget();

  protected:
    // The key of the level that a guard's element enters alone.
    static Key entered_key(const Level& level, int guard);

  private:
    std::shared_ptr<const Model> model_;
    std::shared_ptr<const Excitation> excitation_;
    double duration_;
    Level base_;
    mutable std::shared_mutex mutex_;
    std::map<Key, std::unique_ptr<const Level>> levels_;
    std::map<std::pair<const Level*, const Level*>, std::unique_ptr<const Transition>> transitions_;
    std::map<std::pair<const Level*, int>, std::unique_ptr<const Signal>> entered_;
    std::map<const Transition*, std::unique_ptr<const DefectForm>> defect_forms_;
    std::atomic<int> built_ = 0;  // numbers of levels given so far
};

}  // namespace multiphi
