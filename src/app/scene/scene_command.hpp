// `simulate` and `explain` of a scene in a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "../report.hpp"
#include "ricochet/scene/simulate.hpp"

namespace CLI {
class App;
}

namespace ricochet::app {

/// The arguments of `simulate` or `explain`. Absent ones are taken from the file.
struct SceneRequest {
    std::string file;
    std::optional<double> t_start{}, t_end{}, rtol{}, atol{}, contact_step{};
    std::optional<std::uint64_t> max_events{};
    std::optional<std::size_t> samples{};
    bool json = false;
    bool no_events = false;
    std::optional<std::string> csv{}, plot{}, animate{};
};

/// The requested scene, with its options set.
/// @throws BadInput for an invalid file or option
[[nodiscard]] SceneFile requested_scene(const SceneRequest& request);

/// @return the exit status
int simulate_scene(const SceneRequest& request);
int explain_scene(const SceneRequest& request);

[[nodiscard]] std::string scene_text(const SceneFile& file, const SceneRun& run);

/// The events of a run as JSON, printed a few thousand at a time while the run goes on: the first
/// member of an object that `scene_json` completes.
class PrintedEvents {
public:
    explicit PrintedEvents(const Scene& scene) : scene_(scene) {}
    void add(const SceneEvent& event);
    /// Prints the last of them, and what begins and ends their list.
    void end();

private:
    void begin();

    const Scene& scene_;
    bool begun_ = false;
    bool any_ = false;
    std::string text_;
};

/// @param samples  whether the sampled states are part of it
/// @param begun    whether the object has been begun by `PrintedEvents`
[[nodiscard]] std::string scene_json(const SceneFile& file, const SceneRun& run, bool samples,
                                     bool begun);
/// A line for each body at each sample.
[[nodiscard]] std::string scene_csv(const SceneFile& file, const SceneRun& run);

}  // namespace ricochet::app
