#include "bindings/c/error.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>

#include "base/out_of_turn.hpp"

namespace ricochet::c {

namespace {

/// Message buffer of the thread, allocated in advance so that lack of memory can be reported.
thread_local std::array<char, 1024> message_here{};
thread_local CallbackFailed failed_here;

}  // namespace

void set_message(std::string_view message) noexcept
{
    const std::size_t size = std::min(message.size(), message_here.size() - 1);
    std::memcpy(message_here.data(), message.data(), size);
    message_here[size] = '\0';
}

CallbackFailed& last_failed_callback() noexcept
{
    return failed_here;
}

rc_status status_of_exception() noexcept
{
    try {
        throw;
    } catch (const CallbackFailed& failed) {
        failed_here = failed;
        std::array<char, 256> text{};
        if (failed.guard == RC_NO_GUARD) {
            std::snprintf(text.data(), text.size(), "the callback %s returned %d at t = %.17g",
                          failed.callback, failed.code, failed.t);
        } else {
            std::snprintf(text.data(), text.size(),
                          "the callback %s returned %d for guard %zu at t = %.17g", failed.callback,
                          failed.code, failed.guard, failed.t);
        }
        set_message(text.data());
        return RC_CALLBACK;
    } catch (const Refusal& refusal) {
        set_message(refusal.what());
        return refusal.status();
    } catch (const detail::OutOfTurn& refused) {
        set_message(refused.what());
        return RC_OUT_OF_TURN;
    } catch (const std::bad_alloc&) {
        set_message("there is not enough memory");
        return RC_NO_MEMORY;
    } catch (const std::length_error&) {
        set_message("there is not enough memory: more components than any vector can have");
        return RC_NO_MEMORY;
    } catch (const std::invalid_argument& refused) {
        set_message(refused.what());
        return RC_INVALID;
    } catch (const std::runtime_error& refused) {  // errors in files
        set_message(refused.what());
        return RC_INVALID;
    } catch (const std::exception& unexpected) {
        set_message(unexpected.what());
        return RC_INTERNAL;
    } catch (...) {
        set_message("an exception that is not of the library, as one from a callback");
        return RC_INTERNAL;
    }
}

}  // namespace ricochet::c

extern "C" {

const char* rc_last_error(void)
{
    return ricochet::c::message_here.data();
}

const char* rc_status_name(rc_status status)
{
    switch (static_cast<int>(status)) {
        case RC_OK: return "RC_OK";
        case RC_INVALID: return "RC_INVALID";
        case RC_CALLBACK: return "RC_CALLBACK";
        case RC_NO_MEMORY: return "RC_NO_MEMORY";
        case RC_BUSY: return "RC_BUSY";
        case RC_BAD_HANDLE: return "RC_BAD_HANDLE";
        case RC_WRONG_SIZE: return "RC_WRONG_SIZE";
        case RC_INTERNAL: return "RC_INTERNAL";
        case RC_OUT_OF_TURN: return "RC_OUT_OF_TURN";
        default: return "unknown";
    }
}

const char* rc_version(void)
{
    return RICOCHET_VERSION;
}
}
