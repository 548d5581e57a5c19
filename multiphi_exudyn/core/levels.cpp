#include "levels.hpp"

#include <utility>

#include "level_builder.hpp"
#include "modal_levels.hpp"

namespace multiphi {

Levels::Levels(std::shared_ptr<const Model> model, std::shared_ptr<const Excitation> excitation, double duration)
    : model_(std::move(model)), excitation_(std::move(excitation)), duration_(duration),
      base_(Level::of_base(*model_, *excitation_)) {}

LevelData Levels::data(const Key& key) const {
    const std::shared_ptr<const MovingLevel> moving = model_->levels->level(model_->active_links(key));
    return build_level(*model_, *excitation_, *moving, key, duration_);
}

const Level& Levels::level(const Key& key) {
    {
        const std::shared_lock lock(mutex_);
        const auto found = levels_.find(key);
        if (found != levels_.end()) return *found->second;
    }
    // Without the lock: it takes its time.
    LevelData known = data(key);
    auto built = std::make_unique<const Level>(*model_, *excitation_, std::move(known), built_++);
    const std::unique_lock lock(mutex_);
    return *levels_.try_emplace(key, std::move(built)).first->second;
}

const Transition& Levels::transition(const Level& source, const Level& target) {
    const std::pair<const Level*, const Level*> way{&source, &target};
    {
        const std::shared_lock lock(mutex_);
        const auto found = transitions_.find(way);
        if (found != transitions_.end()) return *found->second;
    }
    auto made = std::make_unique<const Transition>(source, target);
    const std::unique_lock lock(mutex_);
    return *transitions_.try_emplace(way, std::move(made)).first->second;
}

const Signal& Levels::entered_signal(const Level& level, int guard) {
    const std::pair<const Level*, int> place{&level, guard};
    {
        const std::shared_lock lock(mutex_);
        const auto found = entered_.find(place);
        if (found != entered_.end()) return *found->second;
    }
    const Transition& entering = Levels::transition(level, Levels::level(entered_key(level, guard)));
    auto made = std::make_unique<const Signal>(multiphi::entered_signal(entering, level.guards()[guard].element));
    const std::unique_lock lock(mutex_);
    return *entered_.try_emplace(place, std::move(made)).first->second;
}

Key Levels::entered_key(const Level& level, int guard) {
    const Guard& left = level.guards()[guard];
    Key key = level.key();
    // A contact that would slide is seen in the level with slip: entering stick would remove its slip velocity.
    key[left.element] = left.by_velocity ? left.by_velocity->forward : left.target;
    return key;
}

const DefectForm& Levels::defect_form(const Transition& transition) {
    {
        const std::shared_lock lock(mutex_);
        const auto found = defect_forms_.find(&transition);
        if (found != defect_forms_.end()) return *found->second;
    }
    auto made = std::make_unique<const DefectForm>(transition);
    const std::unique_lock lock(mutex_);
    return *defect_forms_.try_emplace(&transition, std::move(made)).first->second;
}

std::size_t Levels::bytes() const {
    const std::shared_lock lock(mutex_);
    std::size_t total = 0;
    for (const auto& [key, level] : levels_) total += level->bytes();
    for (const auto& [way, transition] : transitions_) total += transition->bytes();
    for (const auto& [transition, form] : defect_forms_)
        total += sizeof(double) * static_cast<std::size_t>(form->displaced.size() + form->moving.size());
    for (const auto& [place, signal] : entered_) total += signal->bytes();
    return total;
}

void Levels::forget() {
    const std::unique_lock lock(mutex_);
    entered_.clear();
    defect_forms_.clear();
    transitions_.clear();
    levels_.clear();
}

void Levels::forget_but(const Level& kept) {
    const std::unique_lock lock(mutex_);
    entered_.clear();
    defect_forms_.clear();
    transitions_.clear();
    std::erase_if(levels_, [&](const auto& entry) { return entry.second.get() != &kept; });
}

}  // namespace multiphi
