#include "certify_checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "base/read_file.hpp"
#include "base/strict_json.hpp"

namespace ricochet::learn {

namespace {

using Json = nlohmann::ordered_json;

Json json(const std::vector<std::vector<ValueRange>>& boxes)
{
    Json out = Json::array();
    for (const auto& box : boxes) {
        Json one = Json::array();
        for (const ValueRange& range : box) one.push_back({range.lower, range.upper});
        out.push_back(one);
    }
    return out;
}

/// @throws std::out_of_range for a value that is no count
std::uint64_t count_of(const nlohmann::json& from)
{
    if (!from.is_number_unsigned()) throw std::out_of_range("no count");
    return from.get<std::uint64_t>();
}

/// @throws std::out_of_range for boxes of different dimensions
std::vector<std::vector<ValueRange>> boxes_of(const nlohmann::json& from)
{
    std::vector<std::vector<ValueRange>> out;
    for (const nlohmann::json& box : from) {
        if (box.size() != from.front().size()) throw std::out_of_range("other dimensions");
        out.emplace_back();
        for (const nlohmann::json& range : box) {
            out.back().push_back({range.at(0).get<double>(), range.at(1).get<double>()});
        }
    }
    return out;
}

Json json(const Estimate& e)
{
    return Json::array({e.boxes, e.seconds, e.unproved, e.error});
}

Estimate estimate_of(const nlohmann::json& from)
{
    return {.boxes = from.at(0).get<double>(),
            .seconds = from.at(1).get<double>(),
            .unproved = from.at(2).get<double>(),
            .error = from.at(3).get<double>()};
}

Json json(const Attempt& a)
{
    return Json::array({a.number, a.highest, a.spread, a.closest});
}

Attempt attempt_of(const nlohmann::json& from)
{
    return {.number = static_cast<int>(std::min<std::uint64_t>(count_of(from.at(0)), 1000)),
            .highest = from.at(1).get<double>(),
            .spread = from.at(2).get<double>(),
            .closest = from.at(3).get<double>()};
}

/// Omits parts with a counterexample, which is found again.
Json json(const Started& started)
{
    Json done = Json::array();
    for (std::size_t i = 0; i < started.done.size(); ++i) {
        if (!started.done[i] || !started.done[i]->counterexample.empty()) continue;
        const Tally& tally = *started.done[i];
        done.push_back(
            Json::array({i, tally.boxes, tally.unproved.empty() ? Json() : Json(tally.lowest),
                         json(tally.unproved)}));
    }
    return {{"threshold", started.threshold},     {"lowering", started.lowering},
            {"estimate", json(started.estimate)}, {"seconds", started.seconds},
            {"parts", started.done.size()},       {"done", done}};
}

[[noreturn]] void refuse_certification(const std::filesystem::path& file, std::string_view what)
{
    throw std::runtime_error(fmt::format("checkpoint '{}' {}", file.string(), what));
}

constexpr int deepest = 8;  ///< levels of JSON: lists of boxes in lists of parts

constexpr std::string_view checkpoint_format = "ricochet certification 1";

Started started_of(const nlohmann::json& from)
{
    Started out{.threshold = from.at("threshold").get<double>(),
                .lowering = from.at("lowering").get<double>(),
                .estimate = estimate_of(from.at("estimate")),
                .seconds = from.at("seconds").get<double>()};
    out.done.resize(std::min<std::size_t>(count_of(from.at("parts")), 2 * frontier_boxes));
    for (const nlohmann::json& part : from.at("done")) {
        Tally tally;
        tally.boxes = count_of(part.at(1));
        tally.unproved = boxes_of(part.at(3));
        constexpr double inf = std::numeric_limits<double>::infinity();
        if (!tally.unproved.empty()) {  // JSON has no infinity: a missing bound is null
            tally.lowest = part.at(2).is_null() ? -inf : part.at(2).get<double>();
        }
        out.done.at(count_of(part.at(0))) = std::move(tally);
    }
    return out;
}

}  // namespace

void save(const Progressed& all, const std::string& key, const std::filesystem::path& file)
{
    Json levels = Json::array();
    for (const CertificateLevel& level : all.levels) {
        levels.push_back({{"margin", level.margin},
                          {"threshold", level.threshold},
                          {"boxes", level.boxes},
                          {"seconds", level.seconds},
                          {"unproved", json(level.unproved)}});
    }
    Json estimates = Json::array();
    for (const Estimate& e : all.estimates) estimates.push_back(json(e));
    const Json out{{"format", checkpoint_format},
                   {"key", key},
                   {"levels", levels},
                   {"estimates", estimates},
                   {"attempt", all.attempt ? json(*all.attempt) : Json()},
                   {"current", all.current ? json(*all.current) : Json()}};
    const std::filesystem::path fresh = file.string() + ".part";
    {
        std::ofstream stream(fresh, std::ios::binary | std::ios::trunc);
        stream << out.dump() << '\n';
        stream.close();
        if (!stream) {
            const int why = errno;
            std::error_code ignored;
            std::filesystem::remove(fresh, ignored);
            refuse_certification(file,
                                 "cannot be written: " + std::generic_category().message(why));
        }
    }
    std::error_code error;
    std::filesystem::rename(fresh, file, error);
    if (error) refuse_certification(file, "cannot be written: " + error.message());
}

Progressed load(const std::string& key, const std::filesystem::path& file)
{
    const std::string text = ricochet::detail::read_file(file, [&](const std::string& why) {
        refuse_certification(file, "cannot be read: " + why);
    });
    try {
        const nlohmann::json from = ricochet::detail::parse_strictly(text, deepest);
        if (from.at("format") != checkpoint_format) {
            refuse_certification(file, "is not a certification of this version");
        }
        if (from.at("key") != key) {
            refuse_certification(file, "belongs to another model, another guard or other options");
        }
        Progressed out;
        for (const nlohmann::json& level : from.at("levels")) {
            out.levels.push_back({.margin = level.at("margin").get<double>(),
                                  .threshold = level.at("threshold").get<double>(),
                                  .boxes = count_of(level.at("boxes")),
                                  .seconds = level.at("seconds").get<double>(),
                                  .unproved = boxes_of(level.at("unproved"))});
        }
        for (const nlohmann::json& e : from.at("estimates"))
            out.estimates.push_back(estimate_of(e));
        if (!from.at("attempt").is_null()) out.attempt = attempt_of(from.at("attempt"));
        if (!from.at("current").is_null()) out.current = started_of(from.at("current"));
        return out;
    } catch (const ricochet::detail::JsonTrouble&) {
        refuse_certification(file, "is cut short or has been altered");
    } catch (const nlohmann::json::exception&) {
        refuse_certification(file, "is cut short or has been altered");
    } catch (const std::out_of_range&) {
        refuse_certification(file, "is cut short or has been altered");
    }
}

}  // namespace ricochet::learn
