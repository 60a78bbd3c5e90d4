/* SlotPool of slot_pool.h, with the names used there. An owner takes slots and fills their buffers; two readers look
 * at them and give them back. The owner hands a slot to the first reader, to the second, or shares it between both;
 * the first reader may share its slot with the second, too. What hands slots over (rings in the program) is one place
 * per reader that releases and acquires; a full one refuses, and the giver gives its use back. Runs are endless.
 * Memory: see weak_memory.pml.
 *
 * Checked: a slot that is taken has no other user; no access to a buffer is a race; the count of users never falls
 * below zero; slots come back (the owner can always take again).
 * Left out: that take() starts where it found one last, and the counters. */
#ifndef SLOTS
#define SLOTS 2
#endif
#define THREADS 3
#define MESSAGES (SLOTS + 2) /* one in each users_, one in each place of handing over */
#include "weak_memory.pml"

#ifndef kReclaim
#define kReclaim ACQUIRE
#endif
#ifndef kRelease
#define kRelease RELEASE
#endif

#ifndef SHARE_FIRST /* 0: hands a slot on before it is shared, which share() forbids */
#define SHARE_FIRST 1
#endif

#define kOwner 0
#define held_by(thread) (1 << (thread))
#define handed_to(reader) (1 << (2 + (reader)))
#define message_to(reader) (SLOTS + (reader) - 1)
#define kNone 255
#define by_others(slot) (access_of(0, slot) | access_of(1, slot) | access_of(2, slot))

byte users[SLOTS];
bit zero_visible[SLOTS] = 1; /* the owner's next look at users_ finds 0 */
byte holders[SLOTS];         /* who really has it: threads and places of handing over */
byte handed[3] = kNone;      /* to reader 1 and 2 */
bit being_written[SLOTS];

/* A subtraction reaches the owner some time. */
active [SLOTS] proctype memory() {
  do
  :: atomic { users[_pid] == 0 && !zero_visible[_pid] -> zero_visible[_pid] = 1 }
  od
}

inline give_back(me, slot) {
  atomic {
    assert(users[slot] > 0);
    modifying(me, slot, kRelease);
    users[slot]--
  }
}

inline share(me, slot) {
  atomic {
    assert(users[slot] > 0);
    modifying(me, slot, RELAXED);
    users[slot]++
  }
}

/* Hands one use of the slot over; if there is no room, it is given back. */
inline hand_over(me, reader, slot) {
  if
  :: atomic {
       handed[reader] == kNone ->
       storing(me, message_to(reader), RELEASE);
       handed[reader] = slot;
       holders[slot] = holders[slot] | handed_to(reader)
     }
  :: handed[reader] != kNone -> give_back(me, slot)
  fi
}

/* Hands it over and holds it still. */
inline share_with(me, reader, slot) {
#if SHARE_FIRST
  share(me, slot);
  hand_over(me, reader, slot)
#else
  hand_over(me, reader, slot);
  share(me, slot)
#endif
}

#define done_with(me, slot) holders[slot] = holders[slot] & ~held_by(me)

active proctype owner() {
  byte slot = 0;
  do
  :: /* take(): looks at one slot after the other */
     atomic {
       if
       :: zero_visible[slot] ->
          loading(kOwner, slot, kReclaim);
          assert(users[slot] == 0 && holders[slot] == 0);
          storing(kOwner, slot, RELAXED);
          users[slot] = 1;
          holders[slot] = held_by(kOwner);
          zero_visible[slot] = 0
       :: else -> goto next_slot
       fi
     };
taken:
     atomic { access(kOwner, slot, by_others(slot)); being_written[slot] = 1 };
     atomic { access(kOwner, slot, by_others(slot)); being_written[slot] = 0 };
     if
     :: share_with(kOwner, 2, slot); done_with(kOwner, slot); hand_over(kOwner, 1, slot)
     :: done_with(kOwner, slot); hand_over(kOwner, 1, slot)
     :: done_with(kOwner, slot); hand_over(kOwner, 2, slot)
     fi;
next_slot:
     slot = (slot + 1) % SLOTS
  od
}

active [2] proctype reader() {
  byte slot, me = _pid - SLOTS;
  do
  :: atomic {
       handed[me] != kNone ->
       slot = handed[me];
       handed[me] = kNone;
       holders[slot] = (holders[slot] & ~handed_to(me)) | held_by(me);
       loading(me, message_to(me), ACQUIRE)
     };
     /* the buffer is looked at twice */
     atomic { access(me, slot, access_of(kOwner, slot)); assert(!being_written[slot]) };
     if
     :: me == 1 -> share_with(1, 2, slot)
     :: skip
     fi;
     atomic { access(me, slot, access_of(kOwner, slot)); assert(!being_written[slot]) };
     done_with(me, slot);
     give_back(me, slot);
     slot = 0
  od
}

ltl can_take { [] <> (owner@taken) }
