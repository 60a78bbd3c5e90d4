/* The part of the C++ memory model that the protocols of this folder rely on, for spin, which itself runs the steps of
 * all threads in one order that everybody agrees on.
 *
 * Payload. A payload slot is ordinary memory: two accesses of which neither happens before the other are a data race,
 * and what a racing read returns is anybody's guess. So there are no stale payload words here; every access asserts
 * that the last accesses of the other threads to that slot happened before it. Without a race a read returns the last
 * write, which is what spin's own memory does.
 *
 * Happens-before. The view of a thread is a set: for each thread and slot one bit, "that thread's last access to that
 * slot happened before whatever I do next". This is a vector clock without the clock: a bit is cleared everywhere when
 * its thread accesses its slot anew, so the sets stay finite in endless runs. A message (one value stored in an atomic)
 * carries the view it was released with: a store with RELEASE carries its thread's view, a RELAXED one nothing; an
 * exchange or addition also hands on what the message before it carried (a release sequence). A load with ACQUIRE adds
 * the message's view to its thread's.
 *
 * Atomics. Everyone sees one atomic's values in one order, but not at once: a load may return any value from the last
 * one that its thread saw, or must have seen, up to the newest. Each model says how it does that (a "visible" copy that
 * a process called memory brings up to date at its leisure, or a choice). Exchanges and additions act on the newest
 * value, as C++ demands.
 *
 * Left out: loads that return what is stored later in the same order of events. C++ allows that among relaxed accesses
 * of several atomics; the accesses that carry data here are release and acquire, which forbid it, and the relaxed ones
 * are a thread's own counters and hints on one atomic, where coherence does. The races such reordering would cause (a
 * payload read that sinks below a relaxed "I am done") are found all the same, as missing happens-before.
 *
 * A model defines THREADS, SLOTS and MESSAGES before it includes this file. */

#define RELAXED 0
#define ACQUIRE 1
#define RELEASE 2
#define ACQ_REL 3

#define kAllSlots ((1 << SLOTS) - 1)
#define accesses_by(thread) (kAllSlots << ((thread) * SLOTS))
#define access_of(thread, slot) (1 << ((thread) * SLOTS + (slot)))
#define kEverything ((1 << (THREADS * SLOTS)) - 1)

short view[THREADS] = kEverything;      /* nobody has accessed anything: all of it happened before */
short released[MESSAGES] = kEverything; /* the views that messages carry */
hidden byte each;

/* `thread` reads or writes `slot`; `conflicting` are the accesses by others that must have happened before. */
inline access(thread, slot, conflicting) {
  d_step {
    assert((view[thread] & (conflicting)) == (conflicting)); /* otherwise: a data race */
    each = 0;
    do
    :: each < THREADS -> view[each] = view[each] & ~access_of(thread, slot); each++
    :: else -> break
    od;
    each = 0;
    do
    :: each < MESSAGES -> released[each] = released[each] & ~access_of(thread, slot); each++
    :: else -> break
    od;
    view[thread] = view[thread] | access_of(thread, slot);
    each = 0
  }
}

/* What a store, a load or a read-modify-write of `thread` does to the views. */
#define storing(thread, message, order) released[message] = (((order) & RELEASE) -> view[thread] : 0)
#define loading(thread, message, order) view[thread] = view[thread] | (((order) & ACQUIRE) -> released[message] : 0)
#define modifying(thread, message, order) \
  loading(thread, message, order); \
  released[message] = released[message] | (((order) & RELEASE) -> view[thread] : 0)
