#include "checkpoint.hpp"

#include <string>
#include <string_view>

#include "checkpoint_file.hpp"

namespace ricochet::learn {

namespace {

constexpr std::string_view magic = "ricochet training checkpoint 1\n";
constexpr std::string_view gate_magic = "ricochet gate checkpoint 1\n";

// One list of members serves both reading and writing.
template <class Stream, class Member>
void fields(Member&& member, Stream&& c)
{
    member(c.fingerprint);
    member(c.iteration);
    member(c.seconds);
    for (auto& word : c.random) member(word);
    member(c.parameters);
    member(c.adam.steps);
    member(c.adam.first);
    member(c.adam.second);
    member(c.hard);
    member(c.best_parameters);
    member(c.best_threshold);
    member(c.best_score.misses);
    member(c.best_score.false_alarms);
    member(c.best_score.loss);
}

template <class Stream, class Member>
void gate_fields(Member&& member, Stream&& c)
{
    member(c.fingerprint);
    member(c.round);
    member(c.iteration);
    member(c.iterations);
    member(c.since_best);
    member(c.seconds);
    for (auto& word : c.random) member(word);
    member(c.parameters);
    member(c.adam.steps);
    member(c.adam.first);
    member(c.adam.second);
    member(c.best_cost);
    member(c.best_parameters);
    member(c.best_thresholds);
}

}  // namespace

void save_checkpoint(const Checkpoint& checkpoint, const std::filesystem::path& file)
{
    Writer writer;
    fields([&writer](const auto& member) { writer.put(member); }, checkpoint);
    write_checkpoint(magic, writer, file);
}

void save_checkpoint(const GateCheckpoint& checkpoint, const std::filesystem::path& file)
{
    Writer writer;
    gate_fields([&writer](const auto& member) { writer.put(member); }, checkpoint);
    write_checkpoint(gate_magic, writer, file);
}

Checkpoint load_checkpoint(const std::filesystem::path& file)
{
    const std::string bytes = read_checkpoint(magic, file);
    Checkpoint checkpoint;
    Reader reader(bytes, file);
    fields([&reader](auto& member) { reader.get(member); }, checkpoint);
    reader.finish();
    return checkpoint;
}

GateCheckpoint load_gate_checkpoint(const std::filesystem::path& file)
{
    const std::string bytes = read_checkpoint(gate_magic, file);
    GateCheckpoint checkpoint;
    Reader reader(bytes, file);
    gate_fields([&reader](auto& member) { reader.get(member); }, checkpoint);
    reader.finish();
    return checkpoint;
}

}  // namespace ricochet::learn
