#pragma once
// EPILINE_UNDER_SANITIZER: this build has a sanitizer that owns malloc, locks and stacks.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EPILINE_UNDER_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define EPILINE_UNDER_SANITIZER
#endif
#endif
